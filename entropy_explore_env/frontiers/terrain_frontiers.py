"""The frontier of a height field: candidates above it, and the columns of ground to be seen from them.

Counts are reused as long as nothing changes within range.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from entropy_explore_env.frontiers.blocks import EDGE, NONE, UNEXPLORED, queue_all_around, replace_unreached
from entropy_explore_env.frontiers.frontier_map import BATCH_CELLS, Chart, FrontierConfig, FrontierMap
from entropy_explore_env.frontiers.knowledge import RobotKnowledge
from entropy_explore_env.frontiers.terrain_map import (
    fill_column_costs,
    new_terrain_map,
    take_column,
    update_columns,
    update_terrain,
)
from entropy_explore_env.frontiers.terrain_visibility import (
    ViewModel,
    bound_columns,
    count_below,
    count_columns_from,
    count_columns_in_ball,
    half_widths,
    mean_ground,
)
from entropy_explore_env.frontiers.visibility import new_counter
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind

PATCH_M = 5.0
"""Half the width of the patch whose mean ground is z_av."""
TILE = 8
"""Width in columns of the square tiles by which changes are noted."""
TOO_HIGH = 0.9
"""Candidates higher above z_av than this share of the range are dropped."""


class TerrainFrontiers(FrontierMap):
    """Candidates above a height field; the points of V are columns of ground."""

    def __init__(
        self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig, ceiling: np.ndarray
    ) -> None:
        """Nothing is explored yet."""
        super().__init__(scenario, kind, frontiers)
        (x, y, high), edge = self._size, self._edge
        self._map = new_terrain_map(self._size, kind.robot.planning_radius_m / edge, self._spacing, ceiling)
        self._states, self._costs = self._map.states, self._map.traversal_cost
        self._voxels, self._bounds, self._marks = self._map.voxel, self._map.bounds, self._map.excluded
        self._counter, self.body_reach = new_counter(x * y, self._size), self._map.columns.reach
        turns = min(math.ceil(2.0 * math.pi * self.reach), 720)
        angles = (np.arange(turns) + 0.5) * (2.0 * math.pi / turns)
        self._azimuths = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        self._tilt = kind.sensor.field_of_view_rad[1]
        self._view_model = ViewModel(
            self.reach,
            min_tangent=math.tan(min(max(0.5 * math.pi - self._tilt, 0.0), 1.5)),
            patch=max(round(PATCH_M / edge), 0),
            gamma=-1.0 if frontiers.gamma is None else frontiers.gamma,
            unit=edge,
            highest=TOO_HIGH * self.reach,
            fade=self.reach if frontiers.unexplored_ground == "falling" else math.inf,
        )
        self.point = edge**2
        self._widths, self._far = half_widths(self.reach), self.reach + self._view_model.patch
        self.batch = 1 + BATCH_CELLS // max(math.ceil(turns * self.reach), 1)
        factor = 1.0 if frontiers.gamma is None else edge * high
        self._most = min(math.pi * (self.reach + 2.0) ** 2, float(x * y)) * factor
        """No more is seen from any place."""

    def update(self, view: RobotKnowledge, sigma: float) -> None:
        """See `FrontierMap`."""
        update_terrain(self._map, view.mean.reshape(-1), view.precision.reshape(-1), self._levels(sigma))
        count = int(self._states.noted_count[0])
        self._states.noted_count[0] = 0
        if count > 0:
            slots = np.flatnonzero(self._voxels != NONE)
            near = tiles_near(self._axes_of(self._states.noted[:count]), self._size, self._far)
            x, y, _ = (self._axes_of(self._voxels[slots]) // TILE).T
            self._bounds[slots[near[x, y]]] = math.inf

    def mapped_share(self) -> float:
        """See `FrontierMap`."""
        return float((self._map.ground != NONE).mean())

    def chart(self) -> Chart:
        """See `FrontierMap`."""
        mapped, edge = self._map.ground != NONE, self._map.columns.flags.reshape(self._size[:2]) & EDGE > 0
        ground = np.where(mapped, self._map.ground.astype(float), np.nan)
        return Chart(mapped, np.zeros_like(mapped), edge, ground)

    def upper_bounds(self, slots: np.ndarray) -> np.ndarray:
        """See `FrontierMap`; where nothing is counted yet, by the unexplored columns in range."""
        fresh = slots[np.isinf(self._bounds[slots])]
        if len(fresh):
            unexplored = self._map.columns.state.reshape(self._size[:2]) & UNEXPLORED
            sums, bounds = np.pad(np.cumsum(unexplored, 1, np.int32), ((0, 0), (1, 0))), np.empty(len(fresh))
            bound_columns(self._map, sums, self._widths, self._voxels[fresh], self._view_model, bounds)
            self._bounds[fresh] = bounds
        return np.minimum(self._bounds[slots], self._most)

    def count(self, slots: np.ndarray, voxels: np.ndarray) -> np.ndarray:
        """See `FrontierMap`."""
        seen, weighed = np.empty(len(voxels)), np.empty(len(voxels))
        arrays = self._counter, self._map, voxels, self._azimuths, self._view_model
        count_columns_from(*arrays, self._naive, seen, weighed)
        self._bounds[slots] = seen
        return weighed

    def promise(self, place: np.ndarray) -> None:
        """See `FrontierMap`."""
        arrays = self._counter, self._map, *self._from(place)
        if self._naive:
            count_columns_in_ball(*arrays, self._view_model, True)
        else:
            count_below(*arrays, self._azimuths, self._view_model, True)

    def _from(self, place: np.ndarray) -> tuple[tuple[float, ...], float]:
        """Return an eye at (3,), grid units, and z_av there."""
        eye = tuple(place.tolist())
        return eye, mean_ground(self._map, int(eye[0]), int(eye[1]), self._view_model.patch)

    def _refresh(self, voxels: np.ndarray, radius: int) -> None:
        """See `FrontierMap`."""
        update_columns(self._map, queue_all_around(self._map.columns, voxels // self._size[2], radius))

    def replace_unreached(self, cost: np.ndarray) -> None:
        """See `FrontierMap`."""
        columns = self._map.columns
        before, costs = columns.candidate.copy(), np.empty(len(columns.state))
        fill_column_costs(self._map, cost, costs)
        replace_unreached(columns, costs)
        for block in np.flatnonzero(columns.candidate != before):
            take_column(self._map, block)

    def _gaze_pitches(self, view: RobotKnowledge) -> Sequence[float]:
        """Return one: down, with the lowest rays straight down."""
        return (0.5 * math.pi - 0.5 * self._tilt,)

    def _points_ahead(
        self, place: np.ndarray, view: RobotKnowledge, pitch: float, yaws: Sequence[float]
    ) -> list[int]:
        """See `FrontierMap`."""
        half_turn = 0.5 * view.kind.sensor.field_of_view_rad[0]
        arrays, azimuths = (self._counter, self._map, *self._from(place)), self._azimuths
        ahead = (azimuths @ (math.cos(yaw), math.sin(yaw)) >= math.cos(half_turn) for yaw in yaws)
        return [count_below(*arrays, azimuths[seen], self._view_model, False)[0] for seen in ahead]


def tiles_near(places: np.ndarray, size: tuple[int, int, int], reach: float) -> np.ndarray:
    """Return (X / TILE, Y / TILE) bool, the tiles within reach of (N, 3) indices of voxels."""
    tiles = np.zeros((size[0] // TILE + 1, size[1] // TILE + 1), bool)
    tiles[places[:, 0] // TILE, places[:, 1] // TILE] = True
    wide = math.ceil(min(reach, sum(size)) / TILE)
    return np.asarray(ndimage.maximum_filter(tiles, 2 * wide + 1, mode="constant"))
