"""Geodesic Voronoi cells of a whole grid: the source from which each voxel is cheapest to reach.

Shortest paths from several sources at once (Bhattacharya, Michael & Kumar 2010, sect. 4.1) on the 8- or
26-connected grid, exact: every bucket of the queue is narrower than the cheapest step, so the voxels of a
bucket are final when it is processed. This visits every voxel once. Where only a part of a large world is
wanted, or a robot's body has to fit, `planning` searches.
"""

from __future__ import annotations

import itertools
import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.bucket_queue import (
    BUCKET_WIDTH,
    BucketQueue,
    advance,
    clear_queue,
    free_block,
    new_queue,
    pop_block,
    push,
)
from entropy_explore_env.belief.paths.lattice import DIAGONALS
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, kernel, lean_kernel
from entropy_explore_env.errors import SettingError

UNREACHED = -1
"""Cell of a voxel that no source reaches."""

_SPACE_MOVES = 26
_MAX_COST_RATIO = 1e9


class Tessellation(NamedTuple):
    """Memory and result; P voxels of a grid with an impassable margin around it."""

    half_cost: np.ndarray
    """(P,) float32, half of the traversal cost; inf = impassable, and in the margin."""
    cost: np.ndarray
    """(P,) float64, cost of the path from the nearest source; inf = there is none."""
    cell: np.ndarray
    """(P,) int32, number of that source, or UNREACHED."""
    queue: BucketQueue
    shape: tuple[int, int, int]
    """(X, Y, Z) without the margin."""
    strides: tuple[int, int, int]
    """Differences of index between neighbours along x, y and z; 0 along z in a 2-D world."""

    @property
    def cells(self) -> np.ndarray:
        """(X, Y, Z) int32, the number of the nearest source; a view."""
        return _inside(self, self.cell)

    @property
    def costs(self) -> np.ndarray:
        """(X, Y, Z) float64, the cost of the path from it; a view."""
        return _inside(self, self.cost)


def new_tessellation(shape: tuple[int, int, int]) -> Tessellation:
    """Return memory for a grid of (X, Y, Z) voxels."""
    x, y, z = shape
    strides = (y + 2, 1, 0) if z == 1 else ((y + 2) * (z + 2), z + 2, 1)
    voxels = (x + 2) * (y + 2) * (1 if z == 1 else z + 2)
    return Tessellation(
        np.full(voxels, np.inf, np.float32),
        np.empty(voxels),
        np.empty(voxels, np.int32),
        new_queue((8 if z == 1 else _SPACE_MOVES) * voxels),  # each step pushes a voxel at most once
        shape,
        strides,
    )


def _inside(space: Tessellation, padded: np.ndarray) -> np.ndarray:
    """Return the (X, Y, Z) view of (P,) numbers without their margin."""
    x, y, z = space.shape
    if z == 1:
        return padded.reshape(x + 2, y + 2, 1)[1:-1, 1:-1]
    return padded.reshape(x + 2, y + 2, z + 2)[1:-1, 1:-1, 1:-1]


def tessellate(
    space: Tessellation,
    traversal_cost: np.ndarray,
    sources: np.ndarray,
    length_cost: float = 0.0,
    by_length: bool = True,
) -> None:
    """Assign every voxel to the source from which it is cheapest to reach; of equals, to the first.

    With c the traversal cost, a step from s to t of length ‖s - t‖, in voxel edges, costs

        by length:  (c(s) + c(t)) / 2 · ‖s - t‖ + length_cost · ‖s - t‖
        else:       (c(s) + c(t)) / 2 + length_cost · ‖s - t‖      (Bhattacharya: η = length_cost)

    A diagonal step is possible only if all voxels at the edges that it crosses are passable.

    Args:
        space: Memory for the grid; filled in.
        traversal_cost: (X, Y, Z) float, ≥ 0, of each voxel; inf = impassable.
        sources: (S,) int, numbers of voxels in C order. Impassable ones get no cell, nor do those in the
            voxel of an earlier one.
        length_cost: Cost of a voxel edge of path in addition, ≥ 0.
        by_length: Whether diagonal steps pay the traversal cost for their whole length.

    Raises:
        SettingError: Wrong shapes; the cheapest step is free, or costs less than 1e-9 of the dearest.
    """
    if traversal_cost.shape != space.shape:
        raise SettingError("traversal_cost", traversal_cost.shape, f"an array of shape {space.shape}")
    if len(sources) and not 0 <= int(sources.min()) <= int(sources.max()) < traversal_cost.size:
        raise SettingError(
            "sources", sources.tolist(), f"numbers of voxels, from 0 to {traversal_cost.size - 1}"
        )
    least = float(traversal_cost.min())
    most = float(
        np.where(np.isfinite(traversal_cost), traversal_cost, 0.0).max()
    )  # three times as fast as max's `where=`
    cheapest = min(least, most) + length_cost
    if not (
        least >= 0.0
        and length_cost >= 0.0
        and 0.0 < cheapest
        and (most + length_cost) <= _MAX_COST_RATIO * cheapest
    ):
        allowed = (
            f"costs ≥ 0, of which the cheapest step has more than 1/{_MAX_COST_RATIO:g} of the dearest one's"
        )
        raise SettingError("traversal_cost", (least, most, length_cost), allowed)
    np.multiply(traversal_cost, 0.5, out=_inside(space, space.half_cost), casting="same_kind")
    steps = np.array([(length if by_length else 1.0, length_cost * length) for length in DIAGONALS])
    margin = (1, 1, 0 if space.shape[2] == 1 else 1)
    places = np.stack(np.unravel_index(sources, traversal_cost.shape), axis=-1) + margin
    starts = (places @ np.array(space.strides)).astype(np.int64)
    per_cost = 1.0 / (cheapest * BUCKET_WIDTH)
    _tessellate(
        space, starts, steps, per_cost, None if space.shape[2] == 1 else _moves_in_space(space.strides)
    )


@lru_cache(maxsize=8)
def _moves_in_space(strides: tuple[int, int, int]) -> np.ndarray:
    """Return (26, 3) int64: each neighbour's offset, the step's number of axes, bits of the moves it needs.

    Moves along one axis come first: these are the ones that others need.
    """
    moves: list[tuple[int, ...]] = [m for m in itertools.product((-1, 0, 1), repeat=3) if any(m)]
    moves.sort(key=lambda move: sum(map(abs, move)))
    rows = []
    for move in moves:
        parts = itertools.product(*({0, along} for along in move))
        needs = sum(1 << moves.index((x, y, z)) for x, y, z in parts if x or y or z)
        rows.append((int(np.dot(strides, move)), sum(map(abs, move)), needs))
    return np.array(rows, np.int64)


@inlined_kernel
def _relax(space, voxel, cost, source, per_cost):
    """Use a path to a voxel if it is cheaper than before, or as cheap and from an earlier source."""
    before = space.cost[voxel]
    if cost < before:
        bucket = int(cost * per_cost)
        queued = not math.isinf(before) and int(before * per_cost) == bucket
        space.cost[voxel], space.cell[voxel] = cost, source
        if not queued:
            push(space.queue, bucket, voxel)
    elif cost == before and source < space.cell[voxel]:
        space.cell[voxel] = source


@inlined_kernel
def _relax_in_plane(space, voxel, steps, per_cost):
    """Reach the 8 neighbours of a voxel."""
    half, row = space.half_cost, space.strides[0]
    cost, here, source = space.cost[voxel], np.float64(half[voxel]), space.cell[voxel]
    east, west = half[voxel + 1], half[voxel - 1]
    north, south = half[voxel + row], half[voxel - row]
    factor, base = steps[0, 0], cost + steps[0, 1]
    _relax(space, voxel + 1, base + (here + east) * factor, source, per_cost)
    _relax(space, voxel - 1, base + (here + west) * factor, source, per_cost)
    _relax(space, voxel + row, base + (here + north) * factor, source, per_cost)
    _relax(space, voxel - row, base + (here + south) * factor, source, per_cost)
    factor, base = steps[1, 0], cost + steps[1, 1]
    if east + north < math.inf:
        _relax(space, voxel + 1 + row, base + (here + half[voxel + 1 + row]) * factor, source, per_cost)
    if east + south < math.inf:
        _relax(space, voxel + 1 - row, base + (here + half[voxel + 1 - row]) * factor, source, per_cost)
    if west + north < math.inf:
        _relax(space, voxel - 1 + row, base + (here + half[voxel - 1 + row]) * factor, source, per_cost)
    if west + south < math.inf:
        _relax(space, voxel - 1 - row, base + (here + half[voxel - 1 - row]) * factor, source, per_cost)


@inlined_kernel
def _relax_in_space(space, voxel, steps, per_cost, moves):
    """Reach the 26 neighbours of a voxel."""
    half = space.half_cost
    cost, here, source, passable = space.cost[voxel], np.float64(half[voxel]), space.cell[voxel], 0
    for k in range(_SPACE_MOVES):
        passable |= np.int64(half[voxel + moves[k, 0]] < math.inf) << k
    for k in range(_SPACE_MOVES):
        if passable & moves[k, 2] == moves[k, 2]:
            near, axes = voxel + moves[k, 0], moves[k, 1] - 1
            there = cost + steps[axes, 1] + (here + half[near]) * steps[axes, 0]
            _relax(space, near, there, source, per_cost)


@lean_kernel
def _tessellate(space, starts, steps, per_cost, moves):
    """Fill in costs and cells from all sources.

    Args:
        space: Its traversal costs filled in.
        starts: (S,) int64, voxels of the grid with its margin.
        steps: (3, 2) float64, by number of axes of a step: factor of its mean traversal cost, and its cost in
            addition.
        per_cost: Buckets per unit of cost; no step is shorter than a bucket.
        moves: Of 3-D grids; None = the grid is flat.
    """
    queue, number = space.queue, 0
    clear_queue(queue)
    for voxel in range(len(space.cost)):
        space.cost[voxel], space.cell[voxel] = math.inf, UNREACHED
    for voxel in starts:
        if math.isinf(space.cost[voxel]) and space.half_cost[voxel] < math.inf:
            space.cost[voxel], space.cell[voxel] = 0.0, number
            push(queue, 0, voxel)
        number += 1
    while advance(queue):
        block, count = pop_block(queue)
        current = queue.state[0].current
        for entry in range(1, count + 1):
            voxel = np.int64(queue.blocks[block, entry])
            bucket = int(space.cost[voxel] * per_cost)
            if bucket > current:  # its key lay beyond the ring
                push(queue, bucket, voxel)
            elif bucket == current:  # else it was expanded before
                if moves is None:
                    _relax_in_plane(space, voxel, steps, per_cost)
                else:
                    _relax_in_space(space, voxel, steps, per_cost, moves)
        free_block(queue, block)


def extract_path(
    space: Tessellation, traversal_cost: np.ndarray, voxel: int, length_cost: float, by_length: bool
) -> np.ndarray:
    """Return (N,) int64 voxels of the cheapest path from a cell's source to a voxel in it, both included.

    It does not leave the cell, and is read off the costs backwards; it is empty if no source reaches the
    voxel. Costs are those of `tessellate`.
    """
    steps = np.array([(length if by_length else 1.0, length_cost * length) for length in DIAGONALS])
    cells, costs = space.cells, space.costs
    if cells.reshape(-1)[voxel] == UNREACHED:
        return np.zeros(0, np.int64)
    return _trace_back(cells, costs, traversal_cost, steps, voxel)


@inlined_kernel
def _step_possible(traversal_cost, x, y, z, i, j, k):
    """Return whether all voxels in the box between two neighbouring voxels are passable."""
    for a in range(min(x, i), max(x, i) + 1):
        for b in range(min(y, j), max(y, j) + 1):
            for c in range(min(z, k), max(z, k) + 1):
                if math.isinf(traversal_cost[a, b, c]):
                    return False
    return True


@kernel
def _trace_back(cells, costs, traversal_cost, steps, voxel):
    size = cells.shape
    path = np.empty(cells.size, np.int64)
    path[0], count = voxel, 1
    x, y, z = voxel // (size[1] * size[2]), voxel // size[2] % size[1], voxel % size[2]
    cell = cells[x, y, z]
    while costs[x, y, z] > 0.0:
        best, next_x, next_y, next_z = math.inf, x, y, z
        for i in range(max(x - 1, 0), min(x + 2, size[0])):
            for j in range(max(y - 1, 0), min(y + 2, size[1])):
                for k in range(max(z - 1, 0), min(z + 2, size[2])):
                    if cells[i, j, k] != cell or costs[i, j, k] >= costs[x, y, z]:
                        continue
                    axes = abs(i - x) + abs(j - y) + abs(k - z)
                    mean = 0.5 * (np.float64(traversal_cost[i, j, k]) + np.float64(traversal_cost[x, y, z]))
                    cost = costs[i, j, k] + steps[axes - 1, 1] + mean * steps[axes - 1, 0]
                    if cost < best and _step_possible(traversal_cost, x, y, z, i, j, k):
                        best, next_x, next_y, next_z = cost, i, j, k
        if math.isinf(best):  # the costs are not those of these traversal costs
            return path[:0].copy()
        x, y, z = next_x, next_y, next_z
        path[count] = flat_index(size, x, y, z)
        count += 1
    return path[:count][::-1].copy()
