"""The frontier of a height field: candidates above it, and the columns of ground to be seen from them.

Counts are reused as long as nothing changes within range.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from entropy_explore_env.frontiers.blocks import replace_unreached
from entropy_explore_env.frontiers.frontier_map import FrontierConfig, FrontierMap
from entropy_explore_env.frontiers.terrain_map import (
    fill_column_costs,
    new_terrain_map,
    take_column,
    update_columns,
    update_terrain,
)
from entropy_explore_env.frontiers.terrain_visibility import (
    ViewModel,
    count_below,
    count_columns_from,
    count_columns_in_ball,
    fill_height_factors,
    mean_ground,
)
from entropy_explore_env.frontiers.visibility import yaws_around
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario

PATCH_M = 5.0
"""Half the width of the patch whose mean ground is z_av."""
TOO_HIGH = 0.9
"""Candidates higher above z_av than this share of the range are dropped."""


class TerrainFrontiers(FrontierMap):
    """Candidates above a height field; the points of V are columns of ground."""

    def __init__(
        self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig, ceiling: np.ndarray
    ) -> None:
        """Take the settings, and (X, Y) the lowest layers of the no-fly zone; nothing is explored yet."""
        super().__init__(scenario, kind, frontiers)
        (x, y, high), edge = self._size, self._edge
        self._map = new_terrain_map(self._size, kind.robot.planning_radius_m / edge, self._spacing, ceiling)
        self._states, self._blocks = self._map.states, self._map.columns
        self._costs, self._marks = self._map.traversal_cost, self._map.excluded
        self._voxels = self._map.voxel.reshape(-1)
        self._start(x * y)
        yaws, tilt = yaws_around(self.reach), kind.sensor.field_of_view_rad[1]
        self._rays = np.stack([np.cos(yaws), np.sin(yaws)], axis=-1)
        self._gaze_pitches = (0.5 * math.pi - 0.5 * tilt,)  # the lowest rays lead straight down
        self._model = ViewModel(
            self.reach,
            min_tangent=math.tan(min(max(0.5 * math.pi - tilt, 0.0), 1.5)),
            patch=max(round(PATCH_M / edge), 0),
            gamma=-1.0 if frontiers.gamma is None else frontiers.gamma,
            unit=edge,
            highest=TOO_HIGH * self.reach,
            fade=self.reach if frontiers.unexplored_ground == "falling" else math.inf,
        )
        self.point, self._sight = edge**2, (self.reach + 1.5 * self._model.patch + 2.0, 0.0)
        factor = 1.0 if frontiers.gamma is None else edge * high
        self._most = min(math.pi * (self.reach + 2.0) ** 2, float(x * y)) * factor

    def _read(self, mean: np.ndarray, precision: np.ndarray, levels: tuple[np.float32, np.float32]) -> int:
        """See `FrontierMap`."""
        return int(update_terrain(self._map, mean, precision, levels))

    def _find_candidates(self) -> None:
        """See `FrontierMap`."""
        update_columns(self._map)

    def replace_unreached(self, cost: np.ndarray) -> None:
        """See `FrontierMap`."""
        before, costs = self._blocks.candidate.copy(), np.empty(len(self._blocks.state))
        fill_column_costs(self._map, cost, costs)
        replace_unreached(self._blocks, costs)
        for block in np.flatnonzero(self._blocks.candidate != before):
            take_column(self._map, block)

    def _counted(self, voxels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `FrontierMap`."""
        (seen, weighed), factors = super()._counted(voxels), self._factors(voxels)
        return seen * factors, weighed * factors

    def _count_from(self, voxels: np.ndarray, seen: np.ndarray, weighed: np.ndarray) -> None:
        """See `FrontierMap`."""
        count_columns_from(self._counter, self._map, voxels, self._rays, self._model, seen, weighed)

    def _factors(self, voxels: np.ndarray) -> np.ndarray:
        """Return (K,) height factors of (K,) int32 voxels."""
        factors = np.empty(len(voxels))
        fill_height_factors(self._map, voxels, self._model, factors)
        return factors

    def _count_rays(self, place: np.ndarray, rays: np.ndarray, marking: bool) -> tuple[int, float]:
        """See `FrontierMap`; rays are (D, 2) unit vectors over the ground."""
        return count_below(self._counter, self._map, *self._from(place), rays, self._model, marking)

    def _rays_ahead(self, view: RobotKnowledge, gazes: np.ndarray) -> Sequence[np.ndarray]:
        """See `FrontierMap`."""
        least = math.cos(0.5 * view.kind.sensor.field_of_view_rad[0])
        return [self._rays[self._rays @ (math.cos(yaw), math.sin(yaw)) >= least] for yaw in gazes[:, 0]]

    def _count_ball(self, place: np.ndarray, marking: bool) -> tuple[int, float]:
        """See `FrontierMap`."""
        return count_columns_in_ball(self._counter, self._map, *self._from(place), self._model, marking)

    def _from(self, place: np.ndarray) -> tuple[tuple[float, ...], float]:
        """Return an eye at (3,), grid units, and z_av there."""
        eye = tuple(place.tolist())
        return eye, mean_ground(self._map, int(eye[0]), int(eye[1]), self._model.patch)
