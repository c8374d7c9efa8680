"""A map as a quadtree of interest regions, compressed: what fits through a narrow channel (Sujan, sect. 2.4).

A region in which every voxel was measured becomes one leaf if the information content of the histogram of its
coverages (eqs. 1-2) is not above a threshold; else it is cut in two along each axis: quadrants in plans,
octants in 3-D. A region that nobody measured is left out. A leaf says one mean and one σ for all its voxels,
never a smaller σ than the map has in any of them. What remains is packed without loss by zlib.
"""

from __future__ import annotations

import math
import zlib
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.errors import RecordError, SettingError
from entropy_explore_env.validation import is_number

_MAGIC = b"EEMS\x01"
_HEADER = np.dtype([("shape", "<u4", (3,)), ("nodes", "<u4"), ("leaves", "<u4")])
_SPLIT, _EMPTY, _LEAF = 0, 1, 2
_SPLIT_KNOWN = 3
"""A split region of which every voxel was measured; written as _SPLIT."""
_GREY_LEVELS = 32
"""Intervals of coverage whose histogram is taken."""
_MEANS = 255
"""Steps of a leaf's mean coverage from 0 to 1."""
_FINEST, _STEPS = 2.0**-10, 16.0
"""Least σ that a leaf can say, and steps to twice as much: 255 steps end at 61."""
_LEAST_PRECISION = (_FINEST * 2.0 ** (255 / _STEPS)) ** -2
"""A precision below this one, of a σ that no leaf can say, counts as none."""
_SLACK = 1.0 - 1e-6
"""What a leaf says of precision, rounded to float32, stays below what it was made from."""
_DEEPEST = 64
"""Levels of a tree, at most; a stack holds at most seven siblings of each."""


class MapSummary(NamedTuple):
    """What a summary says of (X, Y, Z) voxels."""

    mean: np.ndarray
    """(X, Y, Z) float32, mean coverage; ½ where it says nothing."""
    precision: np.ndarray
    """(X, Y, Z) float32, 1/σ²; 0 where it says nothing."""


class _Region(NamedTuple):
    """A box of voxels: from `low` up to, not including, `high`."""

    low: tuple[int, int, int]
    high: tuple[int, int, int]


class _Scratch(NamedTuple):
    """Working space of `_cut`."""

    stack: np.ndarray
    """(S, 7) int64, of `_new_stack`."""
    counts: np.ndarray
    """(32,) int64, zeros: the histogram of one region."""


def encode_map(mean: np.ndarray, precision: np.ndarray, threshold_bits: float) -> bytes:
    """The summary of a map.

    Args:
        mean: (X, Y, Z) float32, mean coverage in [0, 1].
        precision: (X, Y, Z) float32, 1/σ² ≥ 0 of what is to be sent; 0 = nothing (σ above 61 counts as that).
        threshold_bits: Most information content of a leaf: 0 bits = only what is alike becomes one, 5 bits
            (32 grey levels) = all that was measured throughout.

    Raises:
        SettingError: The arrays are no two of one shape with three axes, hold numbers out of range, or the
            threshold is no finite number ≥ 0.
    """
    if not isinstance(mean, np.ndarray) or mean.ndim != 3 or mean.size == 0:
        raise SettingError("mean", getattr(mean, "shape", mean), "an array (X, Y, Z)")
    if not isinstance(precision, np.ndarray) or precision.shape != mean.shape:
        raise SettingError("precision", getattr(precision, "shape", precision), f"an array {mean.shape}")
    if not is_number(threshold_bits) or not 0.0 <= threshold_bits < math.inf:
        raise SettingError("threshold_bits", threshold_bits, "a finite number ≥ 0")
    if not (np.min(mean) >= 0.0 and np.max(mean) <= 1.0):
        raise SettingError("mean", "values outside", "coverages from 0 to 1")
    if not (np.min(precision) >= 0.0 and np.max(precision) < math.inf):
        raise SettingError("precision", "values outside", "finite numbers ≥ 0")
    means, known = np.asarray(mean, np.float32), np.asarray(precision, np.float32)
    kinds, leaves = np.empty(2 * means.size, np.uint8), np.empty((2, means.size), np.uint8)
    scratch = _Scratch(_new_stack(), np.zeros(_GREY_LEVELS, np.int64))
    nodes, count = _cut(means, known, float(threshold_bits), scratch, kinds, leaves)
    header = np.array([(mean.shape, nodes, count)], _HEADER)
    content = np.concatenate([_packed(kinds[:nodes]), leaves[0, :count], leaves[1, :count]])
    return _MAGIC + zlib.compress(header.tobytes() + content.tobytes(), 1)


def decode_map(data: bytes, shape: tuple[int, int, int]) -> MapSummary:
    """What a summary says.

    Args:
        data: From `encode_map`.
        shape: (X, Y, Z) of the receiver's map.

    Raises:
        RecordError: It is no summary, cut, broken, or of a map of another shape.
    """
    allowed = f"the whole summary of a map of {shape[0]} × {shape[1]} × {shape[2]} voxels"
    found = f"{len(data)} bytes" if isinstance(data, bytes) else type(data).__name__
    refused = RecordError("map summary", found, allowed)
    voxels = math.prod(shape)
    if not isinstance(data, bytes) or not data.startswith(_MAGIC):
        raise refused
    most = _HEADER.itemsize + 3 * voxels + 1
    unpacking = zlib.decompressobj()
    try:
        content = unpacking.decompress(data[len(_MAGIC) :], most)
    except zlib.error:
        raise refused from None
    if not unpacking.eof or unpacking.unused_data or len(content) < _HEADER.itemsize:
        raise refused
    header = np.frombuffer(content, _HEADER, 1)[0]
    nodes, count = int(header["nodes"]), int(header["leaves"])
    packed = (nodes + 3) // 4
    if tuple(header["shape"].tolist()) != tuple(shape) or nodes > 2 * voxels or count > voxels:
        raise refused
    if len(content) != _HEADER.itemsize + packed + 2 * count:
        raise refused
    body = np.frombuffer(content, np.uint8, offset=_HEADER.itemsize)
    kinds, leaves = _unpacked(body[:packed], nodes), body[packed:].reshape(2, count)
    summary = MapSummary(np.full(shape, 0.5, np.float32), np.zeros(shape, np.float32))
    if not _grow(kinds, leaves, _new_stack(), summary.mean, summary.precision):
        raise refused
    return summary


def tree_bits(data: bytes) -> int:
    """Bits of the tree of a summary that `encode_map` made, before zlib packs it.

    Raises:
        RecordError: It is no summary.
    """
    if not isinstance(data, bytes) or not data.startswith(_MAGIC):
        raise RecordError("map summary", type(data).__name__, "what encode_map returns")
    try:
        return 8 * len(zlib.decompress(data[len(_MAGIC) :]))
    except zlib.error:
        raise RecordError("map summary", f"{len(data)} bytes", "what encode_map returns") from None


def _new_stack() -> np.ndarray:
    """(S, 7) int64: regions that are still to be visited, and whether all of each is known to be measured."""
    return np.zeros((7 * _DEEPEST + 1, 7), np.int64)


def _packed(kinds: np.ndarray) -> np.ndarray:
    """Four kinds of nodes a byte."""
    padded = np.zeros(-(-len(kinds) // 4) * 4, np.uint8)
    padded[: len(kinds)] = kinds
    quarters = padded.reshape(-1, 4)
    return quarters[:, 0] | quarters[:, 1] << 2 | quarters[:, 2] << 4 | quarters[:, 3] << 6


def _unpacked(packed: np.ndarray, nodes: int) -> np.ndarray:
    """(nodes,) uint8 kinds; see `_packed`."""
    return np.stack([packed >> shift & 3 for shift in (0, 2, 4, 6)], axis=1).ravel()[:nodes].copy()


@inlined_kernel
def _begin(stack, shape):
    """Put the whole map on an empty stack."""
    for axis in range(3):
        stack[0, axis], stack[0, 3 + axis] = 0, shape[axis]
    stack[0, 6] = 0


@inlined_kernel
def _push_parts(region, stack, depth, known):
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
def _top(stack, depth):
    """The _Region at a depth of the stack."""
    at = stack[depth]
    return _Region((at[0], at[1], at[2]), (at[3], at[4], at[5]))


@inlined_kernel
def _is_known(precision):
    """Whether a precision is worth sending: σ is within what a leaf can say."""
    return precision >= _LEAST_PRECISION


@inlined_kernel
def _sigma_code(variance):
    """The least code whose σ is not below that of a variance."""
    return max(math.ceil(0.5 * _STEPS * math.log2(variance / (_FINEST * _FINEST))), 0)


@lean_kernel
def _cut(mean, precision, threshold, scratch, kinds, leaves):
    """Cut a map into leaves, depth first.

    Args:
        mean: (X, Y, Z) float32.
        precision: (X, Y, Z) float32.
        threshold: Most information content of a leaf, bits.
        scratch: _Scratch.
        kinds: (N,) uint8, filled with the kinds of the nodes.
        leaves: (2, N) uint8, filled with codes of mean and σ of the leaves.

    Returns:
        (nodes, leaves): how many.
    """
    nodes, count, depth, stack = 0, 0, 1, scratch.stack
    _begin(stack, mean.shape)
    while depth > 0:
        depth -= 1
        region = _top(stack, depth)
        kind = _kind_of(mean, precision, threshold, region, stack[depth, 6] == 1, scratch.counts)
        kinds[nodes] = _SPLIT if kind == _SPLIT_KNOWN else kind
        nodes += 1
        if kind == _SPLIT or kind == _SPLIT_KNOWN:
            depth = _push_parts(region, stack, depth, int(kind == _SPLIT_KNOWN))
        elif kind == _LEAF:
            leaves[0, count], leaves[1, count] = _leaf_of(mean, precision, region)
            count += 1
    return nodes, count


@lean_kernel
def _kind_of(mean, precision, threshold, region, known, counts):
    """Whether a region is split, empty or a leaf: by what was measured, and by eqs. 1-2.

    `known` says that all of it was measured.
    """
    low, high = region.low, region.high
    total = (high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2])
    if not known:
        first = _is_known(precision[low[0], low[1], low[2]])
        for i in range(low[0], high[0]):
            for j in range(low[1], high[1]):
                for k in range(low[2], high[2]):
                    if _is_known(precision[i, j, k]) != first:
                        return _SPLIT
        if not first:
            return _EMPTY
    if total == 1 or _information_bits(mean, region, total, counts) <= threshold:
        return _LEAF
    return _SPLIT_KNOWN


@lean_kernel
def _information_bits(mean, region, total, counts):
    """-Σ q log2 q over the histogram of a region's coverages in equal intervals (Sujan, eqs. 1-2)."""
    low, high = region.low, region.high
    least, most = _GREY_LEVELS, -1
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            for k in range(low[2], high[2]):
                level = min(int(mean[i, j, k] * _GREY_LEVELS), _GREY_LEVELS - 1)
                counts[level] += 1
                least, most = min(least, level), max(most, level)
    bits = 0.0
    for level in range(least, most + 1):
        share = counts[level] / total
        counts[level] = 0
        bits -= share * math.log2(share) if share > 0.0 else 0.0
    return bits


@lean_kernel
def _leaf_of(mean, precision, region):
    """(mean, σ) codes of a leaf: σ² is that of its least known voxel and the spread of its coverages."""
    low, high = region.low, region.high
    total, count, least = 0.0, 0, math.inf
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            for k in range(low[2], high[2]):
                total += np.float64(mean[i, j, k])
                least = min(least, np.float64(precision[i, j, k]))
                count += 1
    code = int(total / count * _MEANS + 0.5)
    said, spread = code / _MEANS, 0.0
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            for k in range(low[2], high[2]):
                error = np.float64(mean[i, j, k]) - said
                spread += error * error
    return code, min(_sigma_code(1.0 / least + spread / count), 255)


@lean_kernel
def _grow(kinds, leaves, stack, mean, precision):
    """Fill in what the leaves of a tree say.

    Args:
        kinds: (N,) uint8, from outside.
        leaves: (2, M) uint8.
        stack: Of `_new_stack`.
        mean: (X, Y, Z) float32, filled where there is a leaf.
        precision: (X, Y, Z) float32, likewise.

    Returns:
        Whether the tree is whole, and has just these nodes and leaves.
    """
    nodes, count, depth = 0, 0, 1
    _begin(stack, mean.shape)
    while depth > 0:
        if nodes == len(kinds):
            return False
        depth -= 1
        region, kind = _top(stack, depth), kinds[nodes]
        nodes += 1
        low, high = region.low, region.high
        if kind == _SPLIT:
            if high[0] - low[0] + high[1] - low[1] + high[2] - low[2] == 3:
                return False
            depth = _push_parts(region, stack, depth, 0)
        elif kind == _LEAF:
            if count == leaves.shape[1]:
                return False
            said = np.float32(leaves[0, count] / _MEANS)
            sigma = _FINEST * 2.0 ** (leaves[1, count] / _STEPS)
            known = np.float32(_SLACK / (sigma * sigma))
            count += 1
            for i in range(low[0], high[0]):
                for j in range(low[1], high[1]):
                    for k in range(low[2], high[2]):
                        mean[i, j, k], precision[i, j, k] = said, known
        elif kind != _EMPTY:
            return False
    return nodes == len(kinds) and count == leaves.shape[1]
