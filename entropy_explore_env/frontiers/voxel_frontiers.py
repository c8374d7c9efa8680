"""The frontier in a map of voxels: cells to stand in, and how many unexplored voxels are seen from them.

The frontier of Yamauchi 1998 are known free cells beside unknown ones. A body that is larger than a voxel
cannot stand in each of them. A frontier cell here is a voxel in which the body may stand and from which it
touches one: its footprint meets a known free voxel beside an unknown one. For a point robot that is the
textbook's frontier cell itself. Voxels lie in blocks. The cell nearest to the middle of its block stands for
all of it in `listed`, the one with the shortest path in `nearest_of_blocks`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from entropy_explore_env.frontiers.blocks import (
    CANDIDATE,
    DROPPED,
    EDGE,
    EXCLUDED,
    NONE,
    new_blocks,
    replace_unreached,
)
from entropy_explore_env.frontiers.frontier_map import FrontierConfig, FrontierMap
from entropy_explore_env.frontiers.groups import Groups, any_large, fill_nearest, new_groups
from entropy_explore_env.frontiers.visibility import (
    count_crossed,
    count_from,
    count_in_ball,
    imagined_pitches,
    rays_around,
    rays_towards,
)
from entropy_explore_env.frontiers.voxel_map import (
    AT_ONCE,
    body_footprint,
    collect_candidates,
    count_connected,
    first_viewing_place,
    keep_unseen,
    update_blocks,
    update_voxels,
    voxels_around,
)
from entropy_explore_env.frontiers.voxel_states import COVERED, UNMAPPED, new_states
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import cell_edge

BLOCK = 4
"""Voxels along the edge of a block, unless settings say otherwise."""
LEAST_GROUP_M2 = 2.5
"""Smallest group of frontier voxels to which drones go in fine grids while there are larger ones."""


class VoxelFrontiers(FrontierMap):
    """The frontier cells of one robot's belief; the points of V are voxels."""

    def __init__(self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig | None = None) -> None:
        """Take the settings; without them, blocks have an edge of BLOCK voxels. Nothing is explored yet."""
        edge, layer = scenario.grid.voxel_size_m, scenario.layer_of(kind.robot)
        super().__init__(scenario, kind, frontiers or FrontierConfig(spacing_m=BLOCK * edge))
        self._states = new_states(self._size, AT_ONCE)
        footprint = body_footprint(self._size, kind.robot.planning_radius_m / edge, layer)
        self._blocks = new_blocks(self._size, self._states.state, footprint, layer, self._spacing)
        self._costs = np.full(scenario.grid.voxels, np.inf, np.float32)
        self._voxels, self._marks = self._blocks.candidate, self._blocks.flags
        self._pitches = imagined_pitches(kind, layer is None)
        self._rays = rays_around(self.reach, self._pitches)
        self._gaze_pitches = (0.0, -0.7, 0.7) if layer is None else (0.0,)
        self.point = edge ** (2 if scenario.grid.flat else 3)
        wide = self.reach + 2.0
        ball = math.pi * wide**2 if self._size[2] == 1 else 4.0 / 3.0 * math.pi * wide**3
        self._most = min(ball, float(scenario.grid.voxels))
        self._radius, self._sight = self.body_reach + 2, (self.reach + 2.0, 1.0)
        least = math.ceil(LEAST_GROUP_M2 / edge**2) if cell_edge(scenario, kind) > 1 else 1
        self._groups = new_groups(scenario.grid.voxels, least)
        self._dropped: dict[int, tuple[bytes, np.ndarray]] = {}
        """Voxel → what its surroundings were when it was dropped, and which edges were dropped with it."""

    def update(self, view: RobotKnowledge, sigma: float) -> None:
        """See `FrontierMap`; dropped cells count again where the map has changed around them."""
        super().update(view, sigma)
        if self.changed:
            self._groups.forget()
            for voxel in [v for v, (was, _) in self._dropped.items() if self._surroundings(v) != was]:
                self._restore(voxel)

    def _read(self, mean: np.ndarray, precision: np.ndarray, levels: tuple[np.float32, np.float32]) -> int:
        """See `FrontierMap`."""
        return int(update_voxels(self._states, self._blocks, self._costs, mean, precision, levels))

    def _find_candidates(self) -> None:
        """See `FrontierMap`."""
        update_blocks(self._blocks, self._costs)
        self._groups.forget()

    def replace_unreached(self, cost: np.ndarray) -> None:
        """See `FrontierMap`."""
        replace_unreached(self._blocks, cost)

    def gains(self, voxels: np.ndarray) -> np.ndarray:
        """Return (K,) how many unknown voxels the sensor would see, all around, from (K,) int32 voxels."""
        return self._counted(voxels)[0]

    def _count_from(self, voxels: np.ndarray, seen: np.ndarray, weighed: np.ndarray) -> None:
        """See `FrontierMap`."""
        arrays = self._counter, self._states.state, self._size, voxels, self._rays
        count_from(*arrays, self.reach, seen, weighed)

    def _count_rays(self, place: np.ndarray, rays: np.ndarray, marking: bool) -> tuple[int, float]:
        """See `FrontierMap`."""
        arrays, start = (self._counter, self._states.state, self._size), tuple(place.tolist())
        return count_crossed(*arrays, start, rays, self.reach, marking)

    def _rays_ahead(self, view: RobotKnowledge, gazes: np.ndarray) -> Sequence[np.ndarray]:
        """See `FrontierMap`."""
        half_turn, half_tilt = 0.5 * np.array(view.kind.sensor.field_of_view_rad)
        yaws = np.linspace(gazes[:, 0] - half_turn, gazes[:, 0] + half_turn, 24, axis=-1)
        if view.planar:
            return list(rays_towards(yaws, self._pitches))
        pitches = np.linspace(gazes[:, 1] - half_tilt, gazes[:, 1] + half_tilt, 5, axis=-1)
        return list(rays_towards(yaws, pitches))

    def _count_ball(self, place: np.ndarray, marking: bool) -> tuple[int, float]:
        """See `FrontierMap`."""
        arrays, start = (self._counter, self._states.state, self._size), tuple(place.tolist())
        return count_in_ball(*arrays, start, self.reach, marking)

    def open_start(self, voxel: int) -> list[int]:
        """See `FrontierMap`."""
        if self.is_known_free(voxel):
            return []
        beside = self._touched_from(voxel)
        free = self._states.state[beside] & (UNMAPPED | COVERED) == 0
        opened: list[int] = beside[free & np.isinf(self._costs[beside])].tolist()
        self._costs[opened] = 1.0
        return opened

    def is_frontier(self, voxel: int) -> bool:
        """Return whether a voxel is a frontier cell."""
        return bool(self._marks[voxel] & CANDIDATE)

    def opening(self, voxel: int, most: int) -> int:
        """Return how many connected free voxels beside unknown ones are at a frontier cell, up to `most`."""
        edges = self._edges_beside(voxel)
        found = np.concatenate([edges, np.empty(most, np.int64)])
        return int(count_connected(self._blocks, found, len(edges), most))

    def unseen_around(self, voxel: int, radius: int) -> np.ndarray:
        """Return (N,) int32 unexplored voxels that are beside known free ones and near a frontier cell.

        Args:
            voxel: The frontier cell.
            radius: Largest distance along each axis, in voxels, from what the body touches in the cell.
        """
        near = voxels_around(self._size, voxel, radius + self.body_reach, self._blocks.layer)
        return near[: keep_unseen(self._blocks, near)]

    def standing_around(self, voxel: int, radius: float) -> np.ndarray:
        """Return (K,) int32 voxels in which the body may stand, within a radius in voxel edges."""
        near = voxels_around(self._size, voxel, int(radius), self._blocks.layer)
        apart = ((self._axes_of(near) - self._axes_of(np.array(voxel))) ** 2).sum(1)
        return near[(apart <= radius * radius) & np.isfinite(self._costs[near])]

    def first_viewing_place(self, places: np.ndarray, voxels: np.ndarray, reach: float) -> int:
        """Return the index of the first of (K,) int32 places; arguments as of the kernel of this name."""
        return int(first_viewing_place(self._blocks, places, voxels, reach))

    def nearest_of_blocks(
        self, lengths_to: Callable[[np.ndarray], np.ndarray], reach: float = math.inf
    ) -> tuple[np.ndarray, np.ndarray]:
        """Find the frontier cell with the shortest path in each block.

        In fine grids, drones find those at large groups of frontier voxels, unless no path leads to one.

        Args:
            lengths_to: (N,) int32 voxels → (N,) lengths of the paths to them; inf = no path.
            reach: Cells with longer paths are left out; inf allowed. A large group beyond it counts.

        Returns:
            (K,) int32 voxels and (K,) float64 lengths in voxel edges, in the order of the blocks.
        """
        cells, of_block = np.empty((2, len(self._marks)), np.int32)
        count = collect_candidates(self._blocks, cells, of_block)
        cells, of_block = cells[:count], of_block[:count]
        lengths = lengths_to(cells)
        nearest = self._nearest(self._groups, cells, lengths, of_block, reach)
        if len(nearest) == 0 and self._groups.least > 1:
            if math.isinf(reach) or not any_large(self._blocks, self._groups):
                nearest = self._nearest(self._groups._replace(least=1), cells, lengths, of_block, reach)
        return cells[nearest], lengths[nearest]

    def _nearest(
        self, groups: Groups, cells: np.ndarray, lengths: np.ndarray, of_block: np.ndarray, reach: float
    ) -> np.ndarray:
        """Return the indices of the cells that `fill_nearest` finds, block by block."""
        nearest = np.full(len(self._voxels), NONE)
        fill_nearest(self._blocks, groups, cells, lengths, of_block, reach, nearest)
        return nearest[nearest != NONE]

    def drop(self, voxel: int, with_edges: bool) -> None:
        """Take out a frontier cell until the map changes around it.

        Args:
            voxel: It could not be reached, or a scan from there did not explore what is unknown beside it.
            with_edges: Whether cells that touch no other known free voxel beside unknown ones go with it.
        """
        edges = self._edges_beside(voxel) if with_edges else np.empty(0, np.int64)
        if voxel in self._dropped:
            edges = np.union1d(edges, self._dropped[voxel][1])
        self._marks[edges] |= DROPPED
        self._marks[voxel] |= EXCLUDED
        self._dropped[voxel] = self._surroundings(voxel), edges
        self._refresh(np.array([voxel]), 2 * self._radius)

    def remember(self, other: VoxelFrontiers, shift: np.ndarray) -> None:
        """Take out what another map has taken out, in whose voxel (0, 0, 0) this one has the indices `shift`.

        This one is larger, and still empty. Dropped cells count again where the map has changed around them.
        """
        out = np.flatnonzero(other._marks & (EXCLUDED | DROPPED))
        self._marks[self.renumbered(other, out, shift)] = other._marks[out] & (EXCLUDED | DROPPED)
        for voxel, (was, edges) in other._dropped.items():
            moved = int(self.renumbered(other, np.array(voxel), shift))
            self._dropped[moved] = was, self.renumbered(other, edges, shift)

    def renumbered(self, other: VoxelFrontiers, voxels: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Return the numbers here of another map's voxels (...); `shift` is that of `remember`."""
        return np.asarray(np.ravel_multi_index(tuple((other._axes_of(voxels) + shift).T), self._size))

    def readmit(self) -> None:
        """See `FrontierMap`; dropped cells count again, too."""
        for voxel in list(self._dropped):
            self._restore(voxel)
        super().readmit()

    def _restore(self, voxel: int) -> None:
        """Let a dropped cell count again."""
        _, edges = self._dropped.pop(voxel)
        self._marks[edges] &= np.uint8(~DROPPED & 0xFF)
        self._marks[voxel] &= np.uint8(~EXCLUDED & 0xFF)
        self._refresh(np.array([voxel]), 2 * self._radius)

    def _surroundings(self, voxel: int) -> bytes:
        """Return the states of the voxels around one."""
        low = [max(int(at) - self._radius, 0) for at in np.unravel_index(voxel, self._size)]
        (x, y, z), wide = low, 2 * self._radius + 1
        state = self._states.state.reshape(self._size)
        return state[x : x + wide, y : y + wide, z : z + wide].tobytes()

    def _edges_beside(self, voxel: int) -> np.ndarray:
        """Return (N,) int64 voxels of the body's footprint in a voxel that lie beside unknown ones."""
        beside = self._touched_from(voxel)
        return beside[self._marks[beside] & EDGE > 0]

    def _touched_from(self, voxel: int) -> np.ndarray:
        """Return (N,) int64 voxels of the body's footprint in a voxel."""
        places = self._axes_of(np.array(voxel)) + self._blocks.footprint
        places = places[((places >= 0) & (places < self._size)).all(1)]
        return np.asarray(np.ravel_multi_index(tuple(places.T), self._size))
