"""Geodesic Voronoi cells of a whole grid: which source each voxel is nearest to, by the cost of the way.

Shortest ways from several sources at once (Bhattacharya, Michael & Kumar 2010, sect. 4.1) on the 8- or
26-connected grid, exact: every bucket of the queue is narrower than the least step, so that a bucket's
voxels are final when it is worked off. Where only a part of a large world is wanted, or a robot's body
has to fit, `planning` searches; this looks at every voxel, and at nothing twice.
"""

from __future__ import annotations

import itertools
import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.bucket_queue import (
    BucketQueue,
    clear_queue,
    free_block,
    go_on,
    new_queue,
    put,
    take_block,
)
from entropy_explore_env.belief.paths.lattice import DIAGONALS
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.errors import SettingError

NOBODY = -1
"""Cell of a voxel that no source reaches."""

_NARROWER = 1.0 - 2.0**-20
"""Buckets are so much narrower than the least step that rounding puts no two ends of a step into one."""
_IN_SPACE = 26
_MOST_TO_LEAST = 1e9


class Tessellation(NamedTuple):
    """Working space and result; P voxels of a grid with a margin around it, at which every way ends."""

    half_rate: np.ndarray
    """(P,) float32, half of what a step to or from a voxel costs; inf = impassable, and the margin."""
    cost: np.ndarray
    """(P,) float64, of the way from the nearest source; inf = none."""
    cell: np.ndarray
    """(P,) int32, number of that source, or NOBODY."""
    queue: BucketQueue
    shape: tuple[int, int, int]
    """(X, Y, Z) without the margin."""
    strides: tuple[int, int, int]
    """Between neighbours along x, y and z; 0 along z in a 2-D world."""

    @property
    def cells(self) -> np.ndarray:
        """(X, Y, Z) int32, the number of the nearest source; a view."""
        return _inside(self, self.cell)

    @property
    def costs(self) -> np.ndarray:
        """(X, Y, Z) float64, the cost of the way from it; a view."""
        return _inside(self, self.cost)


def new_tessellation(shape: tuple[int, int, int]) -> Tessellation:
    """Working space for a grid of (X, Y, Z) voxels."""
    x, y, z = shape
    strides = (y + 2, 1, 0) if z == 1 else ((y + 2) * (z + 2), z + 2, 1)
    voxels = (x + 2) * (y + 2) * (1 if z == 1 else z + 2)
    return Tessellation(
        np.full(voxels, np.inf, np.float32),
        np.empty(voxels),
        np.empty(voxels, np.int32),
        new_queue((8 if z == 1 else _IN_SPACE) * voxels),  # a step to a voxel puts it in at most once
        shape,
        strides,
    )


def _inside(space: Tessellation, padded: np.ndarray) -> np.ndarray:
    """(X, Y, Z) view of (P,) numbers without their margin."""
    x, y, z = space.shape
    if z == 1:
        return padded.reshape(x + 2, y + 2, 1)[1:-1, 1:-1]
    return padded.reshape(x + 2, y + 2, z + 2)[1:-1, 1:-1, 1:-1]


def tessellate(
    space: Tessellation, rates: np.ndarray, sources: np.ndarray, toll: float = 0.0, by_length: bool = True
) -> None:
    """Give every voxel to the source from which the way costs least; of equals, to the first.

    A step from s to t of length ‖s - t‖, in voxel edges, costs

        by length:  (rate(s) + rate(t)) / 2 · ‖s - t‖ + toll · ‖s - t‖
        else:       (rate(s) + rate(t)) / 2 + toll · ‖s - t‖      (Bhattacharya: η = toll)

    A diagonal step needs all voxels that it squeezes past to be passable.

    Args:
        space: Working space of the grid; filled in.
        rates: (X, Y, Z) float, ≥ 0, each; inf = impassable.
        sources: (S,) int, numbers of voxels in C order; impassable ones, and those that share the voxel
            of an earlier one, get no cell.
        toll: What every edge of way costs besides, ≥ 0.
        by_length: Whether diagonal steps pay the rates of their whole length.

    Raises:
        SettingError: Wrong shapes; or the dearest step costs over 1e9 times the cheapest, or that is free.
    """
    if rates.shape != space.shape:
        raise SettingError("rates", rates.shape, f"an array of shape {space.shape}")
    if len(sources) and not 0 <= int(sources.min()) <= int(sources.max()) < rates.size:
        raise SettingError("sources", sources.tolist(), f"numbers of voxels, from 0 to {rates.size - 1}")
    least = float(rates.min())
    most = float(np.where(np.isfinite(rates), rates, 0.0).max())  # three times as fast as max's `where=`
    cheapest = min(least, most) + toll
    if not (least >= 0.0 and toll >= 0.0 and 0.0 < cheapest and (most + toll) <= _MOST_TO_LEAST * cheapest):
        allowed = (
            f"rates and a toll ≥ 0, of which the least step costs more than 1/{_MOST_TO_LEAST:g} of the most"
        )
        raise SettingError("rates", (least, most, toll), allowed)
    np.multiply(rates, 0.5, out=_inside(space, space.half_rate), casting="same_kind")
    steps = np.array([(length if by_length else 1.0, toll * length) for length in DIAGONALS])
    margin = (1, 1, 0 if space.shape[2] == 1 else 1)
    places = np.stack(np.unravel_index(sources, rates.shape), axis=-1) + margin
    starts = (places @ np.array(space.strides)).astype(np.int64)
    per_cost = 1.0 / (cheapest * _NARROWER)
    _tessellate(
        space, starts, steps, per_cost, None if space.shape[2] == 1 else _moves_in_space(space.strides)
    )


@lru_cache(maxsize=8)
def _moves_in_space(strides: tuple[int, int, int]) -> np.ndarray:
    """(26, 3) int64: offset of each neighbour, how many axes it lies along, bits of the moves that it needs.

    The axes come first, so that the first moves are those that others need.
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
def _reach(space, voxel, cost, source, per_cost):
    """A way to a voxel, from a source: take it if it is cheaper, or as cheap and the source comes first."""
    before = space.cost[voxel]
    if cost < before:
        bucket = int(cost * per_cost)
        waits = not math.isinf(before) and int(before * per_cost) == bucket
        space.cost[voxel], space.cell[voxel] = cost, source
        if not waits:
            put(space.queue, bucket, voxel)
    elif cost == before and source < space.cell[voxel]:
        space.cell[voxel] = source


@inlined_kernel
def _step_in_plane(space, voxel, steps, per_cost):
    """Reach the 8 neighbours of a voxel."""
    half, row = space.half_rate, space.strides[0]
    cost, here, source = space.cost[voxel], np.float64(half[voxel]), space.cell[voxel]
    east, west = half[voxel + 1], half[voxel - 1]
    north, south = half[voxel + row], half[voxel - row]
    factor, toll = steps[0, 0], cost + steps[0, 1]
    _reach(space, voxel + 1, toll + (here + east) * factor, source, per_cost)
    _reach(space, voxel - 1, toll + (here + west) * factor, source, per_cost)
    _reach(space, voxel + row, toll + (here + north) * factor, source, per_cost)
    _reach(space, voxel - row, toll + (here + south) * factor, source, per_cost)
    factor, toll = steps[1, 0], cost + steps[1, 1]
    if east + north < math.inf:
        _reach(space, voxel + 1 + row, toll + (here + half[voxel + 1 + row]) * factor, source, per_cost)
    if east + south < math.inf:
        _reach(space, voxel + 1 - row, toll + (here + half[voxel + 1 - row]) * factor, source, per_cost)
    if west + north < math.inf:
        _reach(space, voxel - 1 + row, toll + (here + half[voxel - 1 + row]) * factor, source, per_cost)
    if west + south < math.inf:
        _reach(space, voxel - 1 - row, toll + (here + half[voxel - 1 - row]) * factor, source, per_cost)


@inlined_kernel
def _step_in_space(space, voxel, steps, per_cost, moves):
    """Reach the 26 neighbours of a voxel."""
    half = space.half_rate
    cost, here, source, passable = space.cost[voxel], np.float64(half[voxel]), space.cell[voxel], 0
    for k in range(_IN_SPACE):
        passable |= np.int64(half[voxel + moves[k, 0]] < math.inf) << k
    for k in range(_IN_SPACE):
        if passable & moves[k, 2] == moves[k, 2]:
            near, axes = voxel + moves[k, 0], moves[k, 1] - 1
            there = cost + steps[axes, 1] + (here + half[near]) * steps[axes, 0]
            _reach(space, near, there, source, per_cost)


@lean_kernel
def _tessellate(space, starts, steps, per_cost, moves):
    """Work off the queue of ways from all sources.

    Args:
        space: Its rates filled in; cost and cells are filled.
        starts: (S,) int64, voxels with the margin counted in.
        steps: (3, 2) float64: by axes of a step, the factor of its mean rate, and what it costs besides.
        per_cost: Buckets for a unit of cost; a step is never shorter than a bucket.
        moves: Of 3-D grids; None = the grid is flat.
    """
    queue, number = space.queue, 0
    clear_queue(queue)
    for voxel in range(len(space.cost)):
        space.cost[voxel], space.cell[voxel] = math.inf, NOBODY
    for voxel in starts:
        if math.isinf(space.cost[voxel]) and space.half_rate[voxel] < math.inf:
            space.cost[voxel], space.cell[voxel] = 0.0, number
            put(queue, 0, voxel)
        number += 1
    while go_on(queue):
        block, count = take_block(queue)
        current = queue.numbers[0].current
        for entry in range(1, count + 1):
            voxel = np.int64(queue.blocks[block, entry])
            bucket = int(space.cost[voxel] * per_cost)
            if bucket > current:  # it lay beyond the ring
                put(queue, bucket, voxel)
            elif bucket == current:  # else it was worked off before
                if moves is None:
                    _step_in_plane(space, voxel, steps, per_cost)
                else:
                    _step_in_space(space, voxel, steps, per_cost, moves)
        free_block(queue, block)
