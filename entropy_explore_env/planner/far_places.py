"""Far places that may be worth a drive: uncertain blocks of a belief, and places to look at them from.

The belief is divided into blocks of voxels. The place of a block is, of its voxels that are known to be free
and that a path search reached, the one nearest to its centre. Its remaining bits are those of all its voxels
that nothing covers. Most unknown voxels can never be seen: they are inside of rock. So a second sum ranks the
places: the bits left in known voxels, plus `behind` times those of openings, which are unknown voxels beside
one that is known to be free.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.fields import remaining_bits
from entropy_explore_env.belief.paths.lattice import Costs, Lattice, cell_of, standing_voxel
from entropy_explore_env.belief.paths.search import Search, cost_to
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

NOT_REACHED, NOT_FREE = -1, -2
"""As a place: no voxel of the block that is known to be free was reached; none is known to be free."""
_FOLD_ABOVE = 1e250
"""A product is folded into bits before it could leave a float64."""


class BitCount(NamedTuple):
    """Which bits are counted."""

    target_precision: float  # 1/σ² of a voxel at which nothing remains to be gained
    known_precision: float  # 1/σ² from which on a voxel counts as seen
    behind: float  # Bits that an opening promises, in multiples of its own


class FoundPaths(NamedTuple):
    """What a search for paths found."""

    search: Search
    lattice: Lattice
    costs: Costs


class Blocks(NamedTuple):
    """Blocks of a belief, I, J, K along the axes."""

    edge: int  # Voxels along a block's edge
    bits: np.ndarray  # (I, J, K) float64, remaining bits; 0 outside the window that was looked at
    promised: np.ndarray  # (I, J, K) float64, bits that openings and known voxels promise
    window: np.ndarray  # (3, 2) int64, first block of the window along each axis, and one past the last
    free: np.ndarray  # (V,) bool, voxels of the window that are known to be free


def new_blocks(shape: tuple[int, int, int], edge: int) -> Blocks:
    """Return memory for the blocks of a grid, with edges of up to `edge` voxels."""
    count = tuple(math.ceil(n / edge) for n in shape)
    free = np.zeros(math.prod(shape), np.bool_)
    return Blocks(edge, np.zeros(count), np.zeros(count), np.zeros((3, 2), np.int64), free)


@lean_kernel
def _mark_free(belief, known_precision, low, high, free):
    """Fill in, from `low` up to, not including, `high`, which voxels are known to be free."""
    mean, precision = belief.mean, belief.precision
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            first = flat_index(belief.size, x, y, low[2])
            for offset in range(high[2] - low[2]):
                voxel = np.uint64(first + offset)
                free[voxel] = (precision[voxel] >= known_precision) & (mean[voxel] <= STOP_AT_COVERED)


@inlined_kernel
def _is_opening(free, size, voxel, x, y, z):
    """Return whether one of the six voxels beside an unknown one is known to be free."""
    row, column = size[2], size[1] * size[2]
    return (
        (z > 0 and free[np.uint64(voxel - 1)])
        or (z < size[2] - 1 and free[np.uint64(voxel + 1)])
        or (y > 0 and free[np.uint64(voxel - row)])
        or (y < size[1] - 1 and free[np.uint64(voxel + row)])
        or (x > 0 and free[np.uint64(voxel - column)])
        or (x < size[0] - 1 and free[np.uint64(voxel + column)])
    )


@inlined_kernel
def block_bounds(blocks, size, i, j, k):
    """Return (low, high) of a block: its voxels are those from `low` up to, not including, `high`."""
    edge = blocks.edge
    low = (i * edge, j * edge, k * edge)
    return low, (min(low[0] + edge, size[0]), min(low[1] + edge, size[1]), min(low[2] + edge, size[2]))


@inlined_kernel
def _count_bits(belief, count, free, low, high):
    """Return (bits, promised) of the block of the voxels from `low` up to, not including, `high`."""
    bits, promised = 0.0, 0.0
    latest, left = np.float32(0.0), 0.0  # most voxels have the prior's precision: its logarithm is taken once
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            for z in range(low[2], high[2]):
                voxel = flat_index(belief.size, x, y, z)
                precision = belief.precision[np.uint64(voxel)]
                if precision >= count.target_precision or belief.mean[np.uint64(voxel)] > STOP_AT_COVERED:
                    continue
                if precision != latest:
                    latest, left = precision, remaining_bits(precision, count.target_precision)
                bits += left
                if precision >= count.known_precision:
                    promised += left
                elif _is_opening(free, belief.size, voxel, x, y, z):
                    promised += count.behind * left
    return bits, promised


@lean_kernel
def fill_blocks(belief, count, start, radius, blocks):
    """Fill in the bits of the blocks of a belief around a robot.

    Args:
        belief: A Belief.
        count: A BitCount.
        start: Voxel of the robot.
        radius: Half an edge of the window of voxels that is looked at.
        blocks: Blocks, filled in.
    """
    window, centre = blocks.window, grid_index(belief.size, start)
    for axis in range(3):
        window[axis, 0] = max((centre[axis] - radius) // blocks.edge, 0)
        window[axis, 1] = min((centre[axis] + radius) // blocks.edge + 1, blocks.bits.shape[axis])
    low = block_bounds(blocks, belief.size, window[0, 0] - 1, window[1, 0] - 1, window[2, 0] - 1)[0]
    high = block_bounds(blocks, belief.size, window[0, 1], window[1, 1], window[2, 1])[1]
    low = max(low[0], 0), max(low[1], 0), max(low[2], 0)
    _mark_free(belief, count.known_precision, low, high, blocks.free)
    blocks.bits[:], blocks.promised[:] = 0.0, 0.0
    for i in range(window[0, 0], window[0, 1]):
        for j in range(window[1, 0], window[1, 1]):
            for k in range(window[2, 0], window[2, 1]):
                low, high = block_bounds(blocks, belief.size, i, j, k)
                blocks.bits[i, j, k], blocks.promised[i, j, k] = _count_bits(
                    belief, count, blocks.free, low, high
                )


@lean_kernel
def place_of(paths, blocks, i, j, k):
    """Return the voxel from which a block is looked at: see the top of this file; below 0 = none.

    Where paths are searched in cells of several voxels, it is the voxel in which the body stands in the cell
    of the nearest one, if that is known to be free, too.

    Args:
        paths: FoundPaths from the robot.
        blocks: Blocks, filled in; this one is in the window.
        i: Number of the block along x.
        j: Along y.
        k: Along z.
    """
    size, layer, edge = paths.lattice.grid, paths.lattice.layer, paths.lattice.edge
    low, high = block_bounds(blocks, size, i, j, k)
    place, nearest = NOT_FREE, math.inf
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            level = (2 * x + 1 - low[0] - high[0]) ** 2 + (2 * y + 1 - low[1] - high[1]) ** 2
            if level >= nearest:
                continue
            for z in range(low[2], high[2]):
                away = level + (2 * z + 1 - low[2] - high[2]) ** 2
                voxel = flat_index(size, x, y, z)
                if away >= nearest or not blocks.free[voxel] or (layer >= 0 and z != layer):
                    continue
                place = max(place, NOT_REACHED)
                if math.isinf(cost_to(paths.search, cell_of(paths.lattice, (x, y, z)))):
                    continue
                if edge > 1:
                    cell = (x // edge, y // edge, z // edge)
                    stand = standing_voxel(paths.lattice, paths.costs, cell)[1]
                    voxel = flat_index(size, stand[0], stand[1], stand[2])
                if blocks.free[voxel]:
                    nearest, place = away, voxel
    return place


@lean_kernel
def bits_around(bits, i, j, k):
    """Return the sum of the (I, J, K) bits of a block and of its neighbours."""
    total, count = 0.0, bits.shape
    for x in range(max(i - 1, 0), min(i + 2, count[0])):
        for y in range(max(j - 1, 0), min(j + 2, count[1])):
            for z in range(max(k - 1, 0), min(k + 2, count[2])):
                total += bits[x, y, z]
    return total


@lean_kernel
def promised_around(blocks, i, j, k):
    """Return what openings promise in a block and its neighbours: no more bits than remain there."""
    return min(bits_around(blocks.bits, i, j, k), bits_around(blocks.promised, i, j, k))


@lean_kernel
def fill_remaining(belief, target_precision, blocks):
    """Fill in the remaining bits of all blocks of a belief, and return their sum."""
    shape, edge, size, total = blocks.bits.shape, blocks.edge, belief.size, 0.0
    latest, ratio = np.float32(0.0), 1.0  # most voxels have the prior's precision: it is divided by once
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                bits, growth = 0.0, 1.0
                for x in range(i * edge, min((i + 1) * edge, size[0])):
                    for y in range(j * edge, min((j + 1) * edge, size[1])):
                        for z in range(k * edge, min((k + 1) * edge, size[2])):
                            voxel = flat_index(size, x, y, z)
                            precision = belief.precision[voxel]
                            if precision < target_precision and belief.mean[voxel] <= STOP_AT_COVERED:
                                if precision != latest:
                                    latest, ratio = precision, target_precision / precision
                                growth *= ratio
                                if growth > _FOLD_ABOVE:
                                    bits += math.log2(growth)
                                    growth = 1.0
                blocks.bits[i, j, k] = 0.5 * (bits + math.log2(growth))
                total += blocks.bits[i, j, k]
    return total
