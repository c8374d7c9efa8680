"""Every frontier cell of one robot's belief, kept up to date: known free cells beside unknown ones.

That is the frontier of Yamauchi 1998. A body that is larger than a voxel cannot stand in each of its cells. A
frontier cell here is a voxel in which the body may stand and from which it touches one: its footprint meets a
known free voxel beside an unknown one. For a point robot that is the textbook's frontier cell itself. Voxels
lie in small blocks; of each block the cell with the shortest path stands for all of it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.frontiers.candidates import FrontierConfig
from entropy_explore_env.frontiers.knowledge import RobotKnowledge
from entropy_explore_env.frontiers.lookouts import collect_standing, collect_unseen, first_lookout
from entropy_explore_env.frontiers.voxel_candidates import VoxelCandidates
from entropy_explore_env.frontiers.voxel_map import (
    CANDIDATE,
    DROPPED,
    EDGE,
    EXCLUDED,
    NONE,
    FrontierMap,
    block_span,
    queue_block,
)
from entropy_explore_env.frontiers.voxel_visibility import count_from
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind

BLOCK = 4
"""Voxels along the edge of a block, unless settings say otherwise."""


class FrontierCells(VoxelCandidates):
    """The frontier cells of one robot's belief, and what is expected to be seen from any voxel.

    `update` takes the time of one pass over the precisions, and of what changed; `count` says how many
    unknown voxels the sensor would see from each of K voxels.

    Attributes:
        body_reach: Voxels that the body extends beyond its own, along an axis.
    """

    def __init__(self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig | None = None) -> None:
        """Nothing is known yet; without settings, blocks have an edge of BLOCK voxels."""
        edge = scenario.grid.voxel_size_m
        super().__init__(scenario, kind, frontiers or FrontierConfig(spacing_m=BLOCK * edge))
        self.body_reach = int(np.abs(self._map.footprint).max(initial=0))
        self._radius = self.body_reach + 2
        self._dropped: dict[int, tuple[int, np.ndarray]] = {}
        """Voxel → what its surroundings were when it was dropped, and which edges were dropped with it."""

    def update(self, view: RobotKnowledge, sigma: float) -> None:
        """Bring the cells up to date with a belief; dropped ones count again where the map has changed."""
        super().update(view, sigma)
        if self.changed:
            for voxel in [v for v, (was, _) in self._dropped.items() if self._surroundings(v) != was]:
                self._restore(voxel)

    def is_frontier(self, voxel: int) -> bool:
        """Whether a voxel is a frontier cell."""
        return bool(self._map.flags[voxel] & CANDIDATE)

    def gains(self, voxels: np.ndarray) -> np.ndarray:
        """(K,) how many unknown voxels the sensor would see, all around, from (K,) int32 voxels."""
        gains, weighed = np.empty(len(voxels)), np.empty(len(voxels))
        count_from(self._counter, self._map.state, self._size, voxels, self._tree, self._met, gains, weighed)
        return gains

    def opening(self, voxel: int, most: int) -> int:
        """How many connected known free voxels beside unknown ones there are where a frontier cell is.

        Args:
            voxel: The frontier cell.
            most: No more are counted.
        """
        edges = self._edges_beside(voxel)
        if len(edges) == 0:
            return 0
        return int(count_connected(self._map, edges, np.empty(most + len(edges), np.int64), most))

    def crowds(self, voxels: np.ndarray, radius: int, most: int) -> np.ndarray:
        """(K,) how many known free voxels beside unknown ones there are around each of (K,) int32 voxels.

        Args:
            voxels: Each in the middle of its surroundings.
            radius: Voxels that others may be off along any axis.
            most: Where there are so many, no more are counted.
        """
        counts = np.empty(len(voxels), np.int64)
        fill_crowds(self._map, voxels, radius, most, counts)
        return counts

    def unseen_around(self, voxel: int, radius: int) -> np.ndarray:
        """(N,) int32 unexplored voxels that are beside known free ones and near a frontier cell.

        Args:
            voxel: The frontier cell.
            radius: Largest distance along each axis, in voxels, from what the body touches in the cell.
        """
        wide = radius + self.body_reach
        found = self._room_for(wide)
        return found[: collect_unseen(self._map, voxel, wide, found)]

    def standing_around(self, voxel: int, radius: float) -> np.ndarray:
        """(K,) int32 voxels in which the body may stand, no farther off than a radius in voxel edges."""
        found = self._room_for(int(radius))
        return found[: collect_standing(self._map, voxel, radius, found)]

    def _room_for(self, radius: int) -> np.ndarray:
        """An empty int32 array for all voxels that are at most so many voxels from one along each axis."""
        return np.empty((2 * radius + 1) ** (2 if self._map.layer >= 0 else 3), np.int32)

    def first_lookout(self, places: np.ndarray, unseen: np.ndarray, reach: float) -> int:
        """The index of the first of (K,) voxels that has all of (N,) others in sight; NONE = none has.

        Args:
            places: (K,) int32.
            unseen: (N,) int32; if there are none, no place has them in sight.
            reach: From how far off at most, in voxel edges.
        """
        return int(first_lookout(self._map, places, unseen, reach))

    def nearest_of_blocks(
        self, lengths_to: Callable[[np.ndarray], np.ndarray], reach: float = math.inf
    ) -> tuple[np.ndarray, np.ndarray]:
        """Of each block the frontier cell with the shortest path.

        Args:
            lengths_to: (N,) int32 voxels → (N,) lengths of the paths to them; inf = no path.
            reach: Cells with longer paths are left out; inf allowed.

        Returns:
            (K,) int32 voxels and (K,) float64 lengths in voxel edges, in the order of the blocks.
        """
        blocks = np.flatnonzero(self._map.voxel != NONE)
        cells = np.empty(len(blocks) * math.prod(self._map.across), np.int32)
        ends = np.empty(len(blocks), np.int64)
        cells = cells[: collect_cells(self._map, blocks, cells, ends)]
        voxels, lengths = np.empty(len(blocks), np.int32), np.empty(len(blocks))
        fill_nearest(cells, ends, lengths_to(cells), reach, voxels, lengths)
        found = voxels != NONE
        return voxels[found], lengths[found]

    def of_blocks(self) -> tuple[np.ndarray, np.ndarray]:
        """(K,) int32 a frontier cell of each block, whether or not a path leads to it; (K,) float64 zeros."""
        voxels = self._map.voxel[self._map.voxel != NONE]
        return voxels, np.zeros(len(voxels))

    def drop(self, voxel: int, with_edges: bool) -> None:
        """Take out a frontier cell until the map changes around it.

        Args:
            voxel: It could not be reached, or a scan from there did not explore what is unknown beside it.
            with_edges: Whether cells that touch no other known free voxel beside unknown ones go with it.
        """
        edges = self._edges_beside(voxel) if with_edges else np.empty(0, np.int64)
        before = self._dropped.get(voxel)
        if before is not None:
            edges = np.union1d(edges, before[1])
        self._map.flags[edges] |= DROPPED
        self._map.flags[voxel] |= EXCLUDED
        self._dropped[voxel] = self._surroundings(voxel), edges
        self._refresh(voxel)

    def readmit(self) -> None:
        """See `Candidates`; dropped cells count again, too."""
        for voxel in list(self._dropped):
            self._restore(voxel)
        super().readmit()

    def _restore(self, voxel: int) -> None:
        _, edges = self._dropped.pop(voxel)
        self._map.flags[edges] &= np.uint8(~DROPPED & 0xFF)
        self._map.flags[voxel] &= np.uint8(~EXCLUDED & 0xFF)
        self._refresh(voxel)

    def _surroundings(self, voxel: int) -> int:
        """A number that changes when the map changes around a voxel."""
        return int(sum_of_states(self._map, voxel, self._radius))

    def _edges_beside(self, voxel: int) -> np.ndarray:
        """(N,) int64 voxels of the body's footprint in a voxel that lie beside unknown ones."""
        places = np.array(self._axes_of(voxel)) + self._map.footprint
        places = places[((places >= 0) & (places < self._size)).all(1)]
        beside = np.ravel_multi_index(tuple(places.T), self._size)
        return np.asarray(beside)[self._map.flags[beside] & EDGE > 0]

    def _refresh(self, voxel: int) -> None:
        """Find the frontier cells around a voxel anew."""
        reach, at = 2 * self._radius, np.array(self._axes_of(voxel))
        low = np.maximum(at - reach, 0) // self._map.across
        high = np.minimum(at + reach, np.array(self._size) - 1) // self._map.across
        count = 0
        for block in itertools.product(*(range(a, b + 1) for a, b in zip(low, high, strict=True))):
            count = queue_block(self._map, int(np.ravel_multi_index(block, self._map.blocks)), count)
        self._update_blocks(count)


@lean_kernel
def collect_cells(frontiers: FrontierMap, blocks: np.ndarray, cells: np.ndarray, ends: np.ndarray) -> int:
    """Fill in the frontier cells of (K,) int64 blocks one after the other, and (K,) int64 where each ends.

    Returns:
        How many cells there are.
    """
    count = 0
    for place in range(len(blocks)):
        low, high = block_span(frontiers, blocks[place])
        for x in range(low[0], high[0]):
            for y in range(low[1], high[1]):
                for z in range(low[2], high[2]):
                    voxel = flat_index(frontiers.size, x, y, z)
                    if frontiers.flags[voxel] & CANDIDATE:
                        cells[count] = voxel
                        count += 1
        ends[place] = count
    return count


@lean_kernel
def fill_nearest(
    cells: np.ndarray,
    ends: np.ndarray,
    lengths: np.ndarray,
    reach: float,
    nearest: np.ndarray,
    least: np.ndarray,
) -> None:
    """Fill (K,) int32 and float64 with the first of the nearest cells of each block; NONE, inf = no path.

    Args:
        cells: (N,) int32, as of `collect_cells`.
        ends: (K,) int64, likewise.
        lengths: (N,) of the paths to the cells.
        reach: Longer paths do not count.
        nearest: Filled in.
        least: Likewise, lengths.
    """
    cell = 0
    for place in range(len(ends)):
        nearest[place], least[place] = NONE, math.inf
        while cell < ends[place]:
            if lengths[cell] <= reach and lengths[cell] < least[place]:
                nearest[place], least[place] = cells[cell], lengths[cell]
            cell += 1


@lean_kernel
def count_connected(frontiers: FrontierMap, edges: np.ndarray, found: np.ndarray, most: int) -> int:
    """How many EDGE voxels are connected with some of them, by sides, edges or corners; no more than `most`.

    Args:
        frontiers: Of the robot.
        edges: (N,) int64, the first of them.
        found: (≥ most + N,) int64, scratch space.
        most: Where counting ends.
    """
    size, count, place = frontiers.size, 0, 0
    for edge in edges:
        found[count] = edge
        count += 1
    while place < count and count < most:
        x, y, z = grid_index(size, found[place])
        place += 1
        for i in range(max(x - 1, 0), min(x + 2, size[0])):
            for j in range(max(y - 1, 0), min(y + 2, size[1])):
                for k in range(max(z - 1, 0), min(z + 2, size[2])):
                    near = flat_index(size, i, j, k)
                    if count < most and frontiers.flags[near] & EDGE:
                        known = False
                        for other in range(count):
                            known = known or found[other] == near
                        if not known:
                            found[count] = near
                            count += 1
    return min(count, most)


@lean_kernel
def fill_crowds(
    frontiers: FrontierMap, voxels: np.ndarray, radius: int, most: int, counts: np.ndarray
) -> None:
    """Fill (K,) int64 with how many EDGE voxels lie within a radius of each voxel, along every axis."""
    size = frontiers.size
    for place in range(len(voxels)):
        x, y, z = grid_index(size, voxels[place])
        count = 0
        for i in range(max(x - radius, 0), min(x + radius, size[0] - 1) + 1):
            for j in range(max(y - radius, 0), min(y + radius, size[1] - 1) + 1):
                for k in range(max(z - radius, 0), min(z + radius, size[2] - 1) + 1):
                    if count < most and frontiers.flags[flat_index(size, i, j, k)] & EDGE:
                        count += 1
        counts[place] = count


@lean_kernel
def sum_of_states(frontiers: FrontierMap, voxel: int, radius: int) -> int:
    """A sum over the voxels within a radius, along every axis, that another state of one of them changes."""
    size, state = frontiers.size, frontiers.state
    x, y, z = grid_index(size, voxel)
    total, weight = np.int64(0), np.int64(1)
    for i in range(max(x - radius, 0), min(x + radius, size[0] - 1) + 1):
        for j in range(max(y - radius, 0), min(y + radius, size[1] - 1) + 1):
            for k in range(max(z - radius, 0), min(z + radius, size[2] - 1) + 1):
                total += weight * np.int64(state[flat_index(size, i, j, k)])
                weight = (weight * 31) % 1000003
    return int(total)
