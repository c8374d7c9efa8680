"""Which voxels are visible from none of many places, found out by blocks of both.

All lines from one box of voxels to another lie in their convex hull, the shaft between them (Haines and
Wallace 1991). Where a slice of the shaft holds no free voxel, no voxel of one box is visible from the other.
Boxes of voxels are halved down to single ones, each with the blocks of places that are left over for it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

_LEVELS = 4
"""Number of sizes of boxes, with edges of 8, 4, 2 and 1 voxels."""
SINGLE = _LEVELS - 1
"""Number of the last size."""
_BLOCK = 1 << SINGLE
"""Edge of the blocks of places."""
_SLACK = 1e-9
"""Tolerance of bounds of a slice, in voxel edges."""


class Places(NamedTuple):
    """Places of sensors, P, in B blocks."""

    voxels: np.ndarray  # (P, 3) int64, block by block
    first: np.ndarray  # (B + 1,) int64, number of the first place of each block
    low: np.ndarray  # (B, 3) int64, least indices of a block's places
    high: np.ndarray  # (B, 3) int64, largest ones


class Blocks(NamedTuple):
    """Blocks of places that are left over for the boxes around a voxel, one box of each edge."""

    left: np.ndarray  # (_LEVELS, B) int64, their numbers
    count: np.ndarray  # (_LEVELS,) int64
    voxel: np.ndarray  # (1,) int64, number of the voxel; -1 = none yet


def box_order(voxels: np.ndarray) -> np.ndarray:
    """Return the order (N,) of voxels (N, 3) in which those of each box, of any edge, follow each other."""
    return np.lexsort([column >> level for level in range(_LEVELS) for column in voxels.T])


def places_in_blocks(places: np.ndarray) -> Places:
    """Return the voxels of a mask (X, Y, Z) bool, which holds some, in blocks."""
    voxels = np.argwhere(places)
    voxels = voxels[np.lexsort((voxels // _BLOCK).T)]
    new = np.any(np.diff(voxels // _BLOCK, axis=0), axis=1)
    first = np.concatenate(([0], np.flatnonzero(new) + 1))
    low, high = np.minimum.reduceat(voxels, first), np.maximum.reduceat(voxels, first)
    return Places(voxels, np.append(first, len(voxels)), low, high)


def new_blocks(places: Places) -> Blocks:
    """Return memory for the blocks that are left over."""
    return Blocks(np.zeros((_LEVELS, len(places.low)), np.int64), np.zeros(_LEVELS, np.int64), np.full(1, -1))


def free_counts(free: np.ndarray) -> np.ndarray:
    """Return (X + 1, Y + 1, Z + 1) int64, the number of free voxels below some indices along all axes."""
    counts = np.zeros([edge + 1 for edge in free.shape], np.int64)
    counts[1:, 1:, 1:] = free.cumsum(axis=0).cumsum(axis=1).cumsum(axis=2)
    return counts


@inlined_kernel
def _free_in(counts, low, high):
    """Return the number of free voxels in a box of indices (x, y, z), both ends included."""
    x, y, z = low
    i, j, k = high[0] + 1, high[1] + 1, high[2] + 1
    above = counts[i, j, k] - counts[x, j, k] - counts[i, y, k] + counts[x, y, k]
    return above - (counts[i, j, z] - counts[x, j, z] - counts[i, y, z] + counts[x, y, z])


@inlined_kernel
def _slice_bounds(low, high, to_low, to_high, shares):
    """Return the least and largest index of a slice along an axis that is not the one ahead."""
    down, up = to_low - low, to_high - high
    least = low + min(shares[0] * down, shares[1] * down)
    most = high + max(shares[0] * up, shares[1] * up)
    return math.floor(least + 0.5 - _SLACK), math.floor(most + 0.5 + _SLACK)


@inlined_kernel
def _is_slice_shut(counts, low, high, to_low, to_high, ahead, at):
    """Return whether no voxel is free in the slice at an index along the axis `ahead` of a shaft.

    The shaft leads from one box, from `low` to `high`, to another that lies beyond it along that axis. Lines
    between centres come into the slice and leave it after shares of their length within `shares`.
    """
    shares = (
        (at - 0.5 - high[ahead]) / (to_high[ahead] - high[ahead]),
        (at + 0.5 - low[ahead]) / (to_low[ahead] - low[ahead]),
    )
    x = (at, at) if ahead == 0 else _slice_bounds(low[0], high[0], to_low[0], to_high[0], shares)
    y = (at, at) if ahead == 1 else _slice_bounds(low[1], high[1], to_low[1], to_high[1], shares)
    z = (at, at) if ahead == 2 else _slice_bounds(low[2], high[2], to_low[2], to_high[2], shares)
    return _free_in(counts, (x[0], y[0], z[0]), (x[1], y[1], z[1])) == 0


@lean_kernel
def _is_shut(counts, low, high, to_low, to_high):
    """Return whether some slice of the shaft between two boxes holds no free voxel."""
    for axis in range(3):
        for at in range(high[axis] + 1, to_low[axis]):
            if _is_slice_shut(counts, low, high, to_low, to_high, axis, at):
                return True
        for at in range(to_high[axis] + 1, low[axis]):
            if _is_slice_shut(counts, to_low, to_high, low, high, axis, at):
                return True
    return False


@inlined_kernel
def _gap(low, high, to_low, to_high):
    """Return the square of the least distance between centres of voxels of two boxes."""
    squared = 0
    for axis in range(3):
        apart = max(to_low[axis] - high[axis], low[axis] - to_high[axis], 0)
        squared += apart * apart
    return squared


@lean_kernel
def _keep_blocks(counts, places, squared_range, low, high, blocks, level):
    """Note which blocks, of those that were left over one level before, are left over for a box."""
    kept = 0
    before = len(places.low) if level == 0 else blocks.count[level - 1]
    for number in range(before):
        block = number if level == 0 else blocks.left[level - 1, number]
        to_low = places.low[block, 0], places.low[block, 1], places.low[block, 2]
        to_high = places.high[block, 0], places.high[block, 1], places.high[block, 2]
        if _gap(low, high, to_low, to_high) <= squared_range:
            if not _is_shut(counts, low, high, to_low, to_high):
                blocks.left[level, kept] = block
                kept += 1
    blocks.count[level] = kept


@lean_kernel
def narrow_blocks(counts, places, squared_range, voxels, number, blocks):
    """Find the blocks of places from which a voxel may be visible: those left over for SINGLE.

    Args:
        counts: See `free_counts`.
        places: Places.
        squared_range: Square of the sensor's range, in voxel edges.
        voxels: (N, 3) int64, in the order of `box_order`.
        number: Number of the voxel.
        blocks: Blocks for a voxel before it, changed in place.
    """
    former, same = blocks.voxel[0], blocks.voxel[0] >= 0
    blocks.voxel[0] = number
    for level in range(_LEVELS):
        shift = SINGLE - level
        for axis in range(3):
            same = same and voxels[number, axis] >> shift == voxels[former, axis] >> shift
        if not same:
            x, y, z = voxels[number, 0] >> shift, voxels[number, 1] >> shift, voxels[number, 2] >> shift
            low = x << shift, y << shift, z << shift
            high = (
                min((x + 1) << shift, counts.shape[0] - 1) - 1,
                min((y + 1) << shift, counts.shape[1] - 1) - 1,
                min((z + 1) << shift, counts.shape[2] - 1) - 1,
            )
            _keep_blocks(counts, places, squared_range, low, high, blocks, level)
