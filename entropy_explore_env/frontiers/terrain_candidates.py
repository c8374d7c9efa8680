"""Candidates of a robot's belief of a height field, and the columns of ground to be seen from them.

Counts are reused as long as nothing changes within range.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.frontiers.candidates import BATCH_CELLS, Candidates, Chart, FrontierConfig, as_tuple
from entropy_explore_env.frontiers.knowledge import RobotKnowledge
from entropy_explore_env.frontiers.terrain_map import (
    TerrainMap,
    choose_reached_columns,
    new_terrain_map,
    reset_bounds,
    update_columns,
    update_terrain,
)
from entropy_explore_env.frontiers.terrain_visibility import (
    ColumnCounts,
    ViewModel,
    bound_columns,
    count_below,
    count_below_together,
    count_columns_from,
    count_columns_in_ball,
    half_widths,
    mean_ground,
    sum_rows,
)
from entropy_explore_env.frontiers.voxel_map import EDGE, NONE
from entropy_explore_env.frontiers.voxel_visibility import new_counter
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.viewpoints.evaluation import sees_all_around


class TerrainCandidates(Candidates[TerrainMap]):
    """Candidates and counts above a height field; the points of V are columns of ground."""

    def __init__(
        self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig, ceiling: np.ndarray
    ) -> None:
        """Nothing is explored yet."""
        super().__init__(scenario, kind, frontiers)
        (x, y, _), edge = self._size, scenario.grid.voxel_size_m
        apart = self._spacing(frontiers.spacing_m, edge), self._spacing(frontiers.rise_m, edge)
        self._map = new_terrain_map(self._size, kind.robot.planning_radius_m / edge, *apart, ceiling)
        self._excluded = self._map.excluded
        self._counter = new_counter(x * y, self._size)
        turns = min(math.ceil(2.0 * math.pi * self.reach), 720)
        angles = (np.arange(turns) + 0.5) * (2.0 * math.pi / turns)
        self._azimuths = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        self._tilt = kind.sensor.field_of_view_rad[1]
        self._view_model = ViewModel(
            self.reach,
            min_tangent=math.tan(min(max(0.5 * math.pi - self._tilt, 0.0), 1.5)),
            patch=max(round(frontiers.patch_m / edge), 0),
            gamma=frontiers.gamma or 0.0,
            highest=frontiers.too_high * self.reach,
            fade=self.reach if frontiers.unexplored_ground == "falling" else math.inf,
        )
        self.point = edge**2
        self._factors = np.ones(len(self._map.voxel))
        self._sums = np.zeros((x, y + 1), np.int32)
        self._widths = half_widths(self.reach)
        self.batch = 1 + BATCH_CELLS // max(math.ceil(turns * self.reach), 1)
        self.body_reach = self._map.reach
        self._unit = edge if frontiers.gamma is not None else 1.0

    def update(self, view: RobotKnowledge, sigma: float) -> None:
        """See `Candidates`."""
        levels = self._config.levels(sigma, self._prior)
        update_terrain(self._map, view.mean.reshape(-1), view.precision.reshape(-1), levels)
        sum_rows(self._map, self._sums)
        wide = self.reach + self._view_model.patch
        reset_bounds(self._map.changed, self._size, self._map.voxel, self._map.seen, wide)

    def mapped_share(self) -> float:
        """See `Candidates`."""
        return float((self._map.ground != NONE).mean())

    def chart(self) -> Chart:
        """See `Candidates`."""
        mapped, edge = self._map.ground != NONE, self._map.flags.reshape(self._size[:2]) & EDGE > 0
        ground = np.where(mapped, self._map.ground.astype(float), np.nan)
        return Chart(mapped, np.zeros_like(mapped), edge, ground)

    def upper_bounds(self, slots: np.ndarray) -> np.ndarray:
        """See `Candidates`; for those that are not counted yet, the unexplored columns in range."""
        most, factor = self._map.seen[slots].astype(np.float64), self._factors[slots]
        fresh = np.isinf(most)
        if fresh.any():
            voxels = self._map.voxel[slots[fresh]]
            bound, factor_there = np.empty(len(voxels)), np.empty(len(voxels))
            bound_columns(self._map, self._sums, self._widths, voxels, self._view_model, bound, factor_there)
            most[fresh], factor[fresh] = bound, self._in_metres(factor_there)
        return most * factor

    def greatest_visibility(self) -> float:
        """See `Candidates`."""
        factor = 1.0 if self._config.gamma is None else self._unit * self._size[2]
        within = math.pi * (self.reach + 2.0) ** 2
        return float(min(within, self._counter.stamp.size)) * factor

    def count(self, slots: np.ndarray, voxels: np.ndarray) -> np.ndarray:
        """See `Candidates`."""
        counts = ColumnCounts(*(np.empty(len(slots)) for _ in range(3)))
        naive = self._config.visibility == "naive"
        count_columns_from(self._counter, self._map, voxels, self._azimuths, self._view_model, naive, counts)
        factor = self._in_metres(counts.factor)
        self._map.seen[slots], self._factors[slots] = counts.seen, np.maximum(factor, 1e-12)
        return counts.weighed * factor

    def count_together(self, slot: int, places: np.ndarray) -> float:
        """See `Candidates`."""
        arrays = self._counter, self._map, places, self._azimuths, self._view_model
        return float(count_below_together(*arrays) * self._factors[slot])

    def _in_metres(self, factor: np.ndarray) -> np.ndarray:
        """(K,) height factors; without, 1 where a candidate is low enough to be one."""
        return (factor > 0.0).astype(float) if self._config.gamma is None else factor * self._unit

    def promise(self, place: np.ndarray) -> None:
        """See `Candidates`."""
        arrays = self._counter, self._map, *self._from(place)
        if self._config.visibility == "naive":
            count_columns_in_ball(*arrays, self._view_model, True)
        else:
            count_below(*arrays, self._azimuths, self._view_model, True)

    def _from(self, place: np.ndarray) -> tuple[tuple[float, float, float], float]:
        """An eye at (3,), grid units, and z_av there."""
        eye = as_tuple(place)
        return eye, mean_ground(self._map, int(eye[0]), int(eye[1]), self._view_model.patch)

    def _block_of(self, x: int, y: int, z: int) -> int:
        """See `Candidates`."""
        del z
        return x // self._map.spacing * self._map.rows + y // self._map.spacing

    def _update_blocks(self, count: int) -> None:
        """See `Candidates`."""
        update_columns(self._map, count)

    def drop(self, voxel: int, with_edges: bool) -> None:
        """Take out a candidate that could not be reached."""
        del with_edges
        self.exclude(voxel)

    def replace_unreached(self, cost: np.ndarray) -> None:
        """See `Candidates`."""
        choose_reached_columns(self._map, cost)

    def gaze(self, place: np.ndarray, view: RobotKnowledge) -> tuple[float, float]:
        """Down, with the lowest rays straight down; a sensor with a gap turns to where most is seen."""
        yaw, turn = float(view.pose[3]), view.kind.sensor.field_of_view_rad[0]
        if not sees_all_around(view.kind.sensor):
            (eye, average), best, first = self._from(place), -1, yaw
            for turn_index in range(16):
                heading = first + turn_index * (2.0 * math.pi / 16)
                ahead = self._azimuths @ (math.cos(heading), math.sin(heading)) >= math.cos(turn / 2)
                arrays = self._counter, self._map, eye, average, self._azimuths[ahead]
                points, _ = count_below(*arrays, self._view_model, False)
                if points > best:
                    best, yaw = points, (heading + math.pi) % (2.0 * math.pi) - math.pi
        return yaw, 0.5 * math.pi - 0.5 * self._tilt
