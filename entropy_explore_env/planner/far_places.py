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
from entropy_explore_env.belief.paths.search import cost_to
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

NOT_REACHED = -1
"""As a place: no voxel of the block that is known to be free was reached."""
_FOLD_ABOVE = 1e250
"""A product is folded into bits before it could leave a float64."""


class BitCount(NamedTuple):
    """Which bits are counted."""

    target_precision: float  # 1/σ² of a voxel at which nothing remains to be gained
    known_precision: float  # 1/σ² from which on a voxel counts as seen
    behind: float  # Bits that an opening promises, in multiples of its own


class Blocks(NamedTuple):
    """Blocks of a belief, I, J, K along the axes."""

    edge: int  # Voxels along a block's edge
    bits: np.ndarray  # (I, J, K) float64, remaining bits; 0 outside the window that was looked at
    promised: np.ndarray  # (I, J, K) float64, bits that openings and known voxels promise
    place: np.ndarray  # (I, J, K) int64, known free voxel nearest to its centre, or NOT_REACHED


def new_blocks(shape: tuple[int, int, int], edge: int) -> Blocks:
    """Return memory for the blocks of a grid, with edges of up to `edge` voxels."""
    count = tuple(math.ceil(n / edge) for n in shape)
    return Blocks(edge, np.zeros(count), np.zeros(count), np.full(count, NOT_REACHED, np.int64))


@inlined_kernel
def _is_free(belief, known_precision, voxel):
    """Return whether a voxel is known to be free."""
    return belief.precision[voxel] >= known_precision and belief.mean[voxel] <= STOP_AT_COVERED


@inlined_kernel
def _is_opening(belief, known_precision, voxel, x, y, z):
    """Return whether one of the six voxels beside an unknown one is known to be free."""
    size, row, column = belief.size, belief.size[2], belief.size[1] * belief.size[2]
    return (
        (z > 0 and _is_free(belief, known_precision, voxel - 1))
        or (z < size[2] - 1 and _is_free(belief, known_precision, voxel + 1))
        or (y > 0 and _is_free(belief, known_precision, voxel - row))
        or (y < size[1] - 1 and _is_free(belief, known_precision, voxel + row))
        or (x > 0 and _is_free(belief, known_precision, voxel - column))
        or (x < size[0] - 1 and _is_free(belief, known_precision, voxel + column))
    )


@inlined_kernel
def _fill_block(search, belief, count, layer, low, high):
    """Return (bits, promised, place) of the block of the voxels from `low` up to, not including, `high`."""
    bits, promised, place, nearest = 0.0, 0.0, NOT_REACHED, math.inf
    latest, left = np.float32(0.0), 0.0  # most voxels have the prior's precision: its logarithm is taken once
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            for z in range(low[2], high[2]):
                voxel = flat_index(belief.size, x, y, z)
                if belief.mean[voxel] > STOP_AT_COVERED:
                    continue
                known = belief.precision[voxel] >= count.known_precision
                if belief.precision[voxel] < count.target_precision:
                    if belief.precision[voxel] != latest:
                        latest = belief.precision[voxel]
                        left = remaining_bits(latest, count.target_precision)
                    bits += left
                    if known:
                        promised += left
                    elif _is_opening(belief, count.known_precision, voxel, x, y, z):
                        promised += count.behind * left
                if not known or (layer >= 0 and z != layer) or math.isinf(cost_to(search, voxel)):
                    continue
                away = (
                    (2 * x + 1 - low[0] - high[0]) ** 2
                    + (2 * y + 1 - low[1] - high[1]) ** 2
                    + (2 * z + 1 - low[2] - high[2]) ** 2
                )
                if away < nearest:
                    nearest, place = away, voxel
    return bits, promised, place


@lean_kernel
def fill_blocks(search, belief, count, layer, start, radius, blocks):
    """Fill in the blocks of a belief around a robot after a search for paths.

    Args:
        search: The latest search.
        belief: A Belief.
        count: A BitCount.
        layer: The layer of a planar robot, from which alone places are taken; -1 = it flies.
        start: Voxel of the robot.
        radius: Half an edge of the window of voxels that is looked at; no path was searched beyond.
        blocks: Blocks, filled in.
    """
    size, edge, centre = belief.size, blocks.edge, grid_index(belief.size, start)
    for i in range(blocks.bits.shape[0]):
        for j in range(blocks.bits.shape[1]):
            for k in range(blocks.bits.shape[2]):
                low = (i * edge, j * edge, k * edge)
                high = (min(low[0] + edge, size[0]), min(low[1] + edge, size[1]), min(low[2] + edge, size[2]))
                inside = True
                for axis in range(3):
                    inside &= low[axis] <= centre[axis] + radius and high[axis] > centre[axis] - radius
                bits, promised, place = 0.0, 0.0, NOT_REACHED
                if inside:
                    bits, promised, place = _fill_block(search, belief, count, layer, low, high)
                blocks.bits[i, j, k], blocks.promised[i, j, k] = bits, promised
                blocks.place[i, j, k] = place


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
