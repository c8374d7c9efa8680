"""Candidates of a robot's own belief, in plans and in any 3-D space, and the voxels to be seen from them.

Counts are reused as upper bounds: while the map grows, no more unexplored voxels can be seen from a candidate
than before. Only voxels that turn free may open new views, and those are added to the bounds.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.frontiers.candidates import BATCH_CELLS, Candidates, Chart, FrontierConfig, as_tuple
from entropy_explore_env.frontiers.knowledge import RobotKnowledge
from entropy_explore_env.frontiers.ray_tree import grow_tree
from entropy_explore_env.frontiers.voxel_map import (
    COVERED,
    EDGE,
    MAX_TRACKED_OPENINGS,
    NONE,
    UNMAPPED,
    FrontierMap,
    choose_reached,
    new_frontier_map,
    update_blocks,
    update_frontiers,
)
from entropy_explore_env.frontiers.voxel_visibility import (
    add_opened,
    count_crossed,
    count_from,
    count_in_ball,
    count_in_balls,
    count_together,
    new_counter,
    rays_around,
    rays_towards,
)
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.viewpoints.evaluation import sees_all_around

_ROWS = 15
"""Rows of imagined rays for robots that look up and down."""


class VoxelCandidates(Candidates[FrontierMap]):
    """Candidates and counts in a map of voxels; the points of V are voxels.

    Attributes:
        changed: How many voxels the latest update found in another state.
    """

    def __init__(self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig) -> None:
        """Nothing is explored yet."""
        super().__init__(scenario, kind, frontiers)
        grid, layer = scenario.grid, scenario.layer_of(kind.robot)
        edge = grid.voxel_size_m
        spacing = self._spacing(frontiers.spacing_m, edge)
        self._map = new_frontier_map(grid.shape, kind.robot.planning_radius_m / edge, layer, spacing)
        self._excluded = self._map.flags
        self._counter = new_counter(grid.voxels, grid.shape)
        self._pitches = _pitches(kind, layer is None)
        self._directions = rays_around(self.reach, self._pitches)
        self._tree = grow_tree(self._directions, self.reach, grid.shape)
        self._met = np.empty(self._tree.cells, np.int32)
        self.batch = 1 + BATCH_CELLS // self._tree.cells
        self.point = edge ** (2 if grid.flat else 3)
        self.changed = 0

    def update(self, view: RobotKnowledge, sigma: float) -> None:
        """See `Candidates`."""
        mean, precision = view.mean.reshape(-1), view.precision.reshape(-1)
        levels = self._config.levels(sigma, self._prior)
        self.changed = int(update_frontiers(self._map, mean, precision, levels))
        count, bounds = int(self._map.opened_count[0]), self._map.seen
        self._map.opened_count[0] = 0
        if count > MAX_TRACKED_OPENINGS:
            bounds[:] = math.inf
        elif count > 0 and self._config.visibility == "ray-cast":
            arrays = self._map.opened[:count], self._map.voxel, self._tree, self._met
            add_opened(self._counter, self._map.state, self._size, *arrays, bounds)

    def mapped_share(self) -> float:
        """See `Candidates`."""
        return float((self._map.state & UNMAPPED == 0).mean())

    def chart(self) -> Chart:
        """See `Candidates`."""
        state, edge = self._map.state.reshape(self._size), self._map.flags.reshape(self._size) & EDGE > 0
        mapped, covered = state & UNMAPPED == 0, state & COVERED > 0
        if self._map.layer >= 0:
            mapped, covered, edge = (a[:, :, self._map.layer, None] for a in (mapped, covered, edge))
        mapped, covered, edge = (np.asarray(a.any(2)) for a in (mapped, covered, edge))
        return Chart(mapped, covered, edge, np.full(self._size[:2], np.nan))

    def upper_bounds(self, slots: np.ndarray) -> np.ndarray:
        """See `Candidates`."""
        return self._map.seen[slots].astype(np.float64)

    def greatest_visibility(self) -> float:
        """See `Candidates`."""
        wide = self.reach + 2.0
        within = math.pi * wide**2 if self._size[2] == 1 else 4.0 / 3.0 * math.pi * wide**3
        return float(min(within, self._counter.stamp.size))

    def count(self, slots: np.ndarray, voxels: np.ndarray) -> np.ndarray:
        """See `Candidates`."""
        seen, weighed = np.empty(len(slots)), np.empty(len(slots))
        arrays = self._counter, self._map.state, self._size, voxels
        if self._config.visibility == "naive":
            count_in_balls(*arrays, self.reach, seen, weighed)
        else:
            count_from(*arrays, self._tree, self._met, seen, weighed)
        self._map.seen[slots] = seen
        return weighed

    def count_together(self, slot: int, places: np.ndarray) -> float:
        """See `Candidates`."""
        del slot
        arrays = self._counter, self._map.state, self._size, places, self._directions
        return float(count_together(*arrays, self.reach))

    def promise(self, place: np.ndarray) -> None:
        """See `Candidates`."""
        start = as_tuple(place)
        if self._config.visibility == "naive":
            count_in_ball(self._counter, self._map.state, self._size, start, self.reach, True)
        else:
            count_crossed(
                self._counter, self._map.state, self._size, start, self._directions, self.reach, True
            )

    def _block_of(self, x: int, y: int, z: int) -> int:
        """See `Candidates`."""
        across, blocks = self._map.across, self._map.blocks
        return (x // across[0] * blocks[1] + y // across[1]) * blocks[2] + z // across[2]

    def _update_blocks(self, count: int) -> None:
        """See `Candidates`."""
        update_blocks(self._map, count)

    def replace_unreached(self, cost: np.ndarray) -> None:
        """See `Candidates`."""
        for slot in np.flatnonzero(self._map.voxel != NONE):
            if math.isfinite(cost[self._map.voxel[slot]]):
                continue
            voxel = choose_reached(self._map, cost, slot)
            if voxel != NONE:
                self._map.voxel[slot], self._map.seen[slot] = voxel, math.inf

    def open_start(self, voxel: int) -> list[int]:
        """See `Candidates`."""
        opened: list[int] = []
        if math.isfinite(self._map.traversal_cost[voxel]):
            return opened
        x, y, z = self._axes_of(voxel)
        for offset in self._map.footprint:
            place = x + offset[0], y + offset[1], z + offset[2]
            if all(0 <= i < n for i, n in zip(place, self._size, strict=True)):
                beside = int(np.ravel_multi_index(place, self._size))
                if (
                    math.isinf(self._map.traversal_cost[beside])
                    and self._map.state[beside] & (UNMAPPED | COVERED) == 0
                ):
                    opened.append(beside)
        self._map.traversal_cost[opened] = 1.0
        return opened

    def gaze(self, place: np.ndarray, view: RobotKnowledge) -> tuple[float, float]:
        """See `Candidates`."""
        sensor, yaw = view.kind.sensor, float(view.pose[3])
        turn, tilt = sensor.field_of_view_rad
        all_around = sees_all_around(sensor)
        if all_around and view.planar:
            return yaw, 0.0
        best, gaze = -1, (yaw, 0.0)
        for pitch in (0.0,) if view.planar else (0.0, -0.7, 0.7):
            pitches = self._pitches if view.planar else np.linspace(pitch - tilt / 2, pitch + tilt / 2, 5)
            for turn_index in range(1 if all_around else 16):
                heading = yaw + turn_index * (2.0 * math.pi / 16)
                rays = rays_towards(np.linspace(heading - turn / 2, heading + turn / 2, 24), pitches)
                arrays = self._map.state, self._size, as_tuple(place), rays
                points, _ = count_crossed(self._counter, *arrays, self.reach, False)
                if points > best:
                    best, gaze = points, ((heading + math.pi) % (2.0 * math.pi) - math.pi, pitch)
        return gaze


def _pitches(kind: RobotKind, flies: bool) -> np.ndarray:
    """(rows,) pitches of imagined rays: all of them for flying robots, else the sensor's."""
    tilt = kind.sensor.field_of_view_rad[1]
    if flies:
        return (np.arange(_ROWS) + 0.5) * (math.pi / _ROWS) - math.pi / 2
    rows = min(kind.sensor.rows, _ROWS)
    return np.linspace(-tilt / 2, tilt / 2, rows) if rows > 1 else np.zeros(1)
