"""A map as a quadtree of interest regions, written as decisions of a range coder, and read again.

A region in which every voxel was measured becomes one leaf if the information content of the histogram of its
coverages (Sujan, eqs. 1-2) is not above a threshold; else it is cut in two along each axis: quadrants in
plans, octants in 3-D. A region that was never measured is left out. A leaf says one mean and one σ for all
its voxels, never a smaller σ than the map has in any of them. Nodes come depth first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type
from entropy_explore_env.robots.range_coder import CODER, Coder, code_bit, code_byte, code_change

_EMPTY, _LEAF, _SPLIT, _SPLIT_KNOWN = 0, 1, 2, 3
"""Kinds of regions: nothing measured; one leaf; cut; cut, and all of it was measured."""
_GREY_LEVELS = 32
"""Intervals of coverage whose histogram is taken."""
_UNKNOWN = np.uint8(255)
"""In place of a grey level."""
_MEANS = 255
"""Steps of a leaf's mean coverage from 0 to 1."""
_FINEST, _STEPS = 2.0**-10, 16.0
"""Least σ that a leaf can say, and steps to twice as much: 255 steps end at 61."""
_LEAST_PRECISION = np.float32((_FINEST * 2.0 ** (255 / _STEPS)) ** -2)
"""A precision below this one, of a σ that no leaf can say, counts as none."""
_SLACK = 1.0 - 1e-6
"""What a leaf says of precision, rounded to float32, stays below what it was made from."""
_DEEPEST = 64
"""Levels of a tree, at most; a stack holds at most seven siblings of each."""

_SIZES = 32 * 4
"""Contexts of one question about a region: by the bits of its number of voxels, and the kind before it."""
_ASKS_EMPTY, _ASKS_LEAF, _ASKS_KNOWN = 0, _SIZES, 3 * _SIZES
_ASKS_MEAN = 4 * _SIZES
"""Of the question whether the mean is that of the leaf before: by the mean before, and the answer before."""
_ASKS_SIGMA = _ASKS_MEAN + 6
_TELLS_MEAN = _ASKS_SIGMA + 4
_TELLS_SIGMA = _TELLS_MEAN + 256
_CONTEXTS = _TELLS_SIGMA + 73

WALK = record_type(
    [
        ("size", "i8", (3,)),  # voxels along three axes, rows last: Z, X, Y of a plan, else X, Y, Z
        ("low", "i8", (3,)),  # the box in which alone something was measured: from here
        ("high", "i8", (3,)),  # up to, not including, here
        ("depth", "i8"),  # regions on the stack
        ("kind", "i8"),  # of the node before
        ("mean", "i8"),  # code of the leaf before
        ("sigma", "i8"),
        ("same_mean", "i8"),  # whether that leaf had the mean of the one before it
        ("same_sigma", "i8"),
        ("nodes", "i8"),  # visited so far
        ("leaves", "i8"),
    ]
)
"""How far a walk through a tree has come."""

LEAF = record_type(
    [
        ("low", "i8", (3,)),  # its voxels, from here, by the walk's axes
        ("high", "i8", (3,)),  # up to, not including, here
        ("mean", "f4"),
        ("precision", "f4"),
    ]
)
"""What a leaf says."""


class Tree(NamedTuple):
    """Working space for writing or reading one tree."""

    coder: Coder
    walk: np.ndarray
    """(1,) WALK."""
    stack: np.ndarray
    """(S, 7) int64: regions that are still to be visited, and whether all of each is known to be measured."""
    counts: np.ndarray
    """(32,) int64, zeros: the histogram of one region."""
    levels: np.ndarray
    """(V,) uint8 grey level of each voxel; not used for reading, and may be empty then."""
    leaf: np.ndarray
    """(1,) LEAF, the latest one."""


class Region(NamedTuple):
    """A box of voxels: from `low` up to, not including, `high`."""

    low: tuple[int, int, int]
    high: tuple[int, int, int]


def new_tree(data: np.ndarray, levels: int) -> Tree:
    """Return working space for a tree in data (M,) uint8, of a map of some levels; 0 = only for reading."""
    return Tree(
        coder=Coder(np.zeros(1, CODER), np.zeros(_CONTEXTS, np.uint32), data),
        walk=np.zeros(1, WALK),
        stack=np.zeros((7 * _DEEPEST + 1, 7), np.int64),
        counts=np.zeros(_GREY_LEVELS, np.int64),
        levels=np.zeros(levels, np.uint8),
        leaf=np.zeros(1, LEAF),
    )


@lean_kernel
def begin_walk(tree, size, low, high):
    """Begin with the whole map.

    Args:
        low: Of the box in which alone something was measured.
        high: Its end, not included.
    """
    walk = tree.walk[0]
    turned = size[2] == 1  # a plan: the voxels have the same numbers, and rows are longer
    for axis in range(3):
        source = (axis + 2) % 3 if turned else axis
        walk.size[axis], walk.low[axis], walk.high[axis] = size[source], low[source], high[source]
        tree.stack[0, axis], tree.stack[0, 3 + axis] = 0, size[source]
    tree.stack[0, 6] = 0
    walk.depth, walk.nodes, walk.leaves = 1, 0, 0
    walk.kind, walk.mean, walk.sigma, walk.same_mean, walk.same_sigma = _SPLIT, 0, 0, 1, 0


@inlined_kernel
def push_parts(region, stack, depth, known):
    """Put the parts of a region on the stack: cut in two along each axis that has two voxels or more.

    `known` says whether all of the region was measured, so that its parts need not be asked.

    Returns:
        The new depth; parts come off in the order of x, y, z.
    """
    for part in range(7, -1, -1):
        empty = False
        for axis in range(3):
            low, high = region.low[axis], region.high[axis]
            middle = low + (high - low + 1) // 2
            second = (part >> (2 - axis)) & 1
            stack[depth, axis] = middle if second else low
            stack[depth, 3 + axis] = high if second else middle
            empty = empty or (second == 1 and middle == high)
        stack[depth, 6] = known
        if not empty:
            depth += 1
    return depth


@inlined_kernel
def top(stack, depth):
    """Return the Region at a depth of the stack."""
    at = stack[depth]
    return Region((at[0], at[1], at[2]), (at[3], at[4], at[5]))


@inlined_kernel
def voxels_of(region):
    """Return how many voxels a region has."""
    low, high = region.low, region.high
    return (high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2])


@inlined_kernel
def size_context(walk, voxels):
    """Return the number of a context among _SIZES, by a region's size and the kind of the node before."""
    bits = 0
    while voxels > 0:
        voxels >>= 1
        bits += 1
    return 4 * bits + walk.kind


@lean_kernel
def write_tree(tree, mean, precision, threshold_bits):
    """Cut a map into leaves of at most `threshold_bits`, and write the tree; precisions may be 0 here.

    Only what is in the walk's box is looked at.
    """
    fill_levels(tree.walk[0], mean, precision, tree.levels)
    while next_leaf(tree, threshold_bits):
        code_mean, code_sigma = leaf_codes(tree, mean, precision)
        code_leaf(tree, code_mean, code_sigma)


@lean_kernel
def read_leaf(tree):
    """Read on to the next leaf, which is in `tree.leaf` then; returns whether there is one.

    Any data lead to some tree of the map: that is what a checksum is for.

    Args:
        tree: Tree, its walk begun, its coder reading.
    """
    if not next_leaf(tree, 0.0):
        return False
    code_leaf(tree, 0, 0)
    walk, leaf = tree.walk[0], tree.leaf[0]
    told = _FINEST * 2.0 ** (walk.sigma / _STEPS)
    leaf.mean, leaf.precision = np.float32(walk.mean / _MEANS), np.float32(_SLACK / (told * told))
    return True


@lean_kernel
def next_leaf(tree, threshold_bits):
    """Write or read nodes up to the next leaf, whose region is in `tree.leaf` then; whether there is one."""
    walk, stack, coder, leaf = tree.walk[0], tree.stack, tree.coder, tree.leaf[0]
    while walk.depth > 0:
        walk.depth -= 1
        region, known = top(stack, walk.depth), stack[walk.depth, 6]
        kind = _EMPTY
        if not coder.record[0].reads:
            kind = kind_of(tree, region, threshold_bits)
        kind = code_kind(coder, walk, voxels_of(region), known, kind)
        walk.kind = kind
        walk.nodes += 1
        if kind == _LEAF:
            for axis in range(3):
                leaf.low[axis], leaf.high[axis] = region.low[axis], region.high[axis]
            return True
        if kind != _EMPTY:
            walk.depth = push_parts(region, stack, walk.depth, int(kind == _SPLIT_KNOWN))
    return False


@lean_kernel
def code_kind(coder, walk, voxels, known, kind):
    """Write or read what kind a region of this many voxels is. `known` says that all was measured."""
    context = size_context(walk, voxels)
    if known == 0 and code_bit(coder, _ASKS_EMPTY + context, int(kind != _EMPTY)) == 0:
        return _EMPTY
    if voxels == 1 or code_bit(coder, _ASKS_LEAF + known * _SIZES + context, int(kind != _LEAF)) == 0:
        return _LEAF
    if known == 0 and code_bit(coder, _ASKS_KNOWN + context, int(kind == _SPLIT_KNOWN)) == 0:
        return _SPLIT
    return _SPLIT_KNOWN


@lean_kernel
def code_leaf(tree, mean, sigma):
    """Write or read the codes of a leaf's mean and σ, which are those of the walk's latest leaf then."""
    walk, coder = tree.walk[0], tree.coder
    extreme = 1 if walk.mean == 0 else (2 if walk.mean == _MEANS else 0)
    same_mean = code_bit(coder, _ASKS_MEAN + 2 * extreme + walk.same_mean, int(mean == walk.mean))
    if same_mean == 0:
        walk.mean = code_byte(coder, _TELLS_MEAN, mean)
    same_sigma = code_bit(coder, _ASKS_SIGMA + 2 * same_mean + walk.same_sigma, int(sigma == walk.sigma))
    if same_sigma == 0:
        walk.sigma = (walk.sigma + code_change(coder, _TELLS_SIGMA, sigma - walk.sigma)) & 255
    walk.same_mean, walk.same_sigma = same_mean, same_sigma
    walk.leaves += 1


@lean_kernel
def fill_levels(walk, mean, precision, levels):
    """Fill in the grey levels of the voxels in the walk's box."""
    size, low, high = walk.size, walk.low, walk.high
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            row = (i * size[1] + j) * size[2]
            for voxel in range(row + low[2], row + high[2]):
                level = np.uint8(min(int(mean[voxel] * np.float32(_GREY_LEVELS)), _GREY_LEVELS - 1))
                levels[voxel] = level if precision[voxel] >= _LEAST_PRECISION else _UNKNOWN


@lean_kernel
def kind_of(tree, region, threshold_bits):
    """Return whether a region is empty, a leaf, or cut: by what was measured, and by eqs. 1-2."""
    walk, levels, size = tree.walk[0], tree.levels, tree.walk[0].size
    i0, i1 = max(region.low[0], walk.low[0]), min(region.high[0], walk.high[0])
    j0, j1 = max(region.low[1], walk.low[1]), min(region.high[1], walk.high[1])
    k0, k1 = max(region.low[2], walk.low[2]), min(region.high[2], walk.high[2])
    if i0 >= i1 or j0 >= j1 or k0 >= k1:
        return _EMPTY
    least, most = _UNKNOWN, np.uint8(0)
    for i in range(i0, i1):
        for j in range(j0, j1):
            row = (i * size[1] + j) * size[2]
            for voxel in range(row + k0, row + k1):
                least, most = min(least, levels[voxel]), max(most, levels[voxel])
    voxels = voxels_of(region)
    if least == _UNKNOWN:
        return _EMPTY
    if most == _UNKNOWN or voxels > (i1 - i0) * (j1 - j0) * (k1 - k0):
        return _SPLIT
    alike = least == most or information_bits(tree, region, voxels) <= threshold_bits
    return _LEAF if alike else _SPLIT_KNOWN


@lean_kernel
def information_bits(tree, region, voxels):
    """Return -Σ q log2 q over the histogram of a region's coverages in equal intervals (Sujan, eqs. 1-2)."""
    low, high, size, counts = region.low, region.high, tree.walk[0].size, tree.counts
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            row = (i * size[1] + j) * size[2]
            for voxel in range(row + low[2], row + high[2]):
                counts[tree.levels[voxel]] += 1
    bits = 0.0
    for level in range(len(counts)):
        if counts[level] > 0:
            share = counts[level] / voxels
            bits -= share * math.log2(share)
            counts[level] = 0
    return bits


@lean_kernel
def leaf_codes(tree, mean, precision):
    """Return the leaf's codes of mean and σ: σ² of its least known voxel, and the spread of coverages."""
    low, high, size = tree.leaf[0].low, tree.leaf[0].high, tree.walk[0].size
    total, count, least = 0.0, 0, math.inf
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            row = (i * size[1] + j) * size[2]
            for voxel in range(row + low[2], row + high[2]):
                total += np.float64(mean[voxel])
                least = min(least, np.float64(precision[voxel]))
                count += 1
    code = int(total / count * _MEANS + 0.5)
    said, spread = code / _MEANS, 0.0
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            row = (i * size[1] + j) * size[2]
            for voxel in range(row + low[2], row + high[2]):
                error = np.float64(mean[voxel]) - said
                spread += error * error
    variance = 1.0 / least + spread / count
    least_code = max(math.ceil(0.5 * _STEPS * math.log2(variance / (_FINEST * _FINEST))), 0)
    return code, min(least_code, 255)
