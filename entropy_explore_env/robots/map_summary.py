"""A map as a summary: a quadtree of interest regions, compressed: what fits through a narrow channel (Sujan).

Step 4 of the paper (sect. 2.4). A summary is two bytes that say what it is, a checksum (CRC-32) over the
grid's shape and over what follows, and the tree of `map_tree`, packed without loss by a range coder. Missions
call the kernels, so that what they count is what `encode_map` returns.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.errors import RecordError, SettingError
from entropy_explore_env.robots.map_tree import (
    Tree,
    begin_walk,
    new_tree,
    read_leaf,
    write_tree,
)
from entropy_explore_env.robots.range_coder import begin_reading, begin_writing, end_writing
from entropy_explore_env.robots.ranges import COUNT, PAST, Values, ranged_type
from entropy_explore_env.settings.validation import is_number

_MAGIC = np.uint8(0xE5)
"""The first byte; the second one is a form."""
_LEARNED, _FLAT = np.uint8(2), np.uint8(3)
"""Forms: contexts learn; or all decisions count as equally likely, so that the summary is never too long."""
_CHECKSUM, _FIRST = 2, 6
"""Where the checksum begins, and the tree."""
_BITS_PER_NODE, _BITS_PER_LEAF = 2, 16
"""Of a tree that is not packed: a kind, and codes of mean and σ."""


SUMMARY = ranged_type(
    [
        ("sent_s", "f8", PAST),  # when the robot sent its latest summary; 0 = it has not
        ("sent", "i8", COUNT),  # how many it has sent
        # the box in which it has measured since then
        ("low", "i8", Values(0, "size"), (3,)),  # its first voxel
        ("high", "i8", Values(0, "size"), (3,)),  # one past its last one; zeros = it has measured nothing
    ],
)
"""What a robot of a mission keeps for its next summary, beside the map."""

PARCEL = ranged_type(
    [
        ("place", "i8", Values(0, "last_place")),  # of the summary that a delayed message carries
        ("bytes", "i8", Values(0, "summary_bytes")),  # its length; 0 = it carries none
    ],
)
"""What a delayed message of a mission carries."""


def _checksum_steps() -> np.ndarray:
    """Return (256,) uint32: what a byte does to a CRC-32 (ISO 3309)."""
    steps = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        steps = np.where(steps & 1, steps >> 1 ^ np.uint32(0xEDB88320), steps >> 1).astype(np.uint32)
    return steps


_STEPS = _checksum_steps()


class MapSummary(NamedTuple):
    """What a summary says of (X, Y, Z) voxels."""

    mean: np.ndarray
    """(X, Y, Z) float32, mean coverage; ½ where it says nothing."""
    precision: np.ndarray
    """(X, Y, Z) float32, 1/σ²; 0 where it says nothing."""


def summary_bytes(voxels: int) -> int:
    """Return the bytes that no summary of a map of this many voxels exceeds.

    Where all decisions count as equally likely, fewer than two nodes a voxel are told by three decisions each
    at most, and each of them that is a leaf by 25 more: 31 bits a voxel. A 256th more is what rounding costs.
    """
    return _FIRST + 4 * voxels + voxels // 64 + 16


def new_summary_tree(voxels: int) -> Tree:
    """Return working space for writing and reading summaries of maps of this many voxels."""
    return new_tree(np.zeros(summary_bytes(voxels), np.uint8), voxels)


def encode_map(mean: np.ndarray, precision: np.ndarray, threshold_bits: float) -> bytes:
    """Return the summary of a map.

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
    if not (np.min(precision) >= 0.0 and np.max(precision) <= np.finfo(np.float32).max):
        raise SettingError("precision", "values outside", "finite float32 numbers ≥ 0")
    held = [np.ascontiguousarray(array, np.float32).ravel() for array in (mean, precision)]
    x, y, z = mean.shape
    shape, corner, tree = (x, y, z), (0, 0, 0), new_summary_tree(mean.size)
    length = write_summary(tree, *held, shape, corner, shape, float(threshold_bits))
    return tree.coder.data[:length].tobytes()


def decode_map(data: bytes, shape: tuple[int, int, int]) -> MapSummary:
    """Return what a summary says.

    Args:
        data: From `encode_map`.
        shape: (X, Y, Z) of the receiver's map.

    Raises:
        RecordError: It is no summary, cut, broken, or of a map of another shape.
    """
    tree = _opened(data, shape)
    mean, precision = np.full(shape, 0.5, np.float32), np.zeros(shape, np.float32)
    _fill(tree, mean.ravel(), precision.ravel())
    return MapSummary(mean, precision)


def tree_bits(data: bytes, shape: tuple[int, int, int]) -> int:
    """Return the bits of a summary's tree before it is packed: two a node, sixteen a leaf.

    Args:
        data: From `encode_map`.
        shape: (X, Y, Z) of the map.

    Raises:
        RecordError: As of `decode_map`.
    """
    tree = _opened(data, shape)
    while read_leaf(tree):
        pass
    walk = tree.walk[0]
    return _BITS_PER_NODE * int(walk["nodes"]) + _BITS_PER_LEAF * int(walk["leaves"])


def is_summary(data: object, shape: tuple[int, int, int]) -> bool:
    """Return whether something is the whole summary of a map (X, Y, Z)."""
    if not isinstance(data, bytes) or not _FIRST <= len(data) <= summary_bytes(math.prod(shape)):
        return False
    x, y, z = shape
    known = data[0] == _MAGIC and data[1] in (_LEARNED, _FLAT)
    told = int.from_bytes(data[_CHECKSUM:_FIRST], "little")
    return known and checksum(_bytes_of(data), np.int64(len(data)), (x, y, z)) == told


def _bytes_of(data: bytes) -> np.ndarray:
    """Return (M,) uint8, of the kind for which kernels are compiled."""
    return np.frombuffer(data, np.uint8).copy()


def _opened(data: bytes, shape: tuple[int, int, int]) -> Tree:
    """Return the tree of a summary, of which nothing is read yet."""
    if not is_summary(data, shape):
        found = f"{len(data)} bytes" if isinstance(data, bytes) else type(data).__name__
        allowed = f"the whole summary of a map of {shape[0]} × {shape[1]} × {shape[2]} voxels"
        raise RecordError("map summary", found, allowed)
    tree, (x, y, z) = new_tree(_bytes_of(data), 0), shape
    open_summary(tree, len(data), (x, y, z))
    return tree


@lean_kernel
def write_summary(tree, mean, precision, size, low, high, threshold_bits):
    """Write the summary of a map into the data of a Tree; returns how many bytes it has.

    Args:
        tree: Tree, with room for `summary_bytes`.
        precision: (V,) float32, 1/σ² of what is to be sent; looked at in the box only.
        low: (x, y, z), of the box in which alone something was measured.
        high: Its end, not included.
        threshold_bits: Most information content of a leaf.
    """
    data, length = tree.coder.data, 0
    for flat in range(2):
        begin_writing(tree.coder, _FIRST, flat == 1)
        begin_walk(tree, size, low, high)
        write_tree(tree, mean, precision, threshold_bits)
        length = end_writing(tree.coder, _FIRST)
        data[0], data[1] = _MAGIC, _FLAT if flat == 1 else _LEARNED
        if length <= len(data):
            break
    crc = checksum(data, length, size)
    for place in range(4):
        data[_CHECKSUM + place] = np.uint8((crc >> (8 * place)) & 255)
    return length


@lean_kernel
def open_summary(tree, length, size):
    """Begin to read the summary in the first bytes of a Tree's data; returns whether its form is known.

    Its checksum is not looked at: a message of a mission arrives whole, or not at all.
    """
    data = tree.coder.data
    if data[0] != _MAGIC or (data[1] != _LEARNED and data[1] != _FLAT):
        return False
    begin_reading(tree.coder, _FIRST, length, data[1] == _FLAT)
    begin_walk(tree, size, (0, 0, 0), size)
    return True


@lean_kernel
def checksum(data, length, size):
    """Return the CRC-32 of a grid's shape, in numbers of 32 bits, and of form and tree of a summary."""
    crc = 0xFFFFFFFF
    for axis in range(3):
        for place in range(4):
            crc = (crc >> 8) ^ np.int64(_STEPS[(crc ^ (size[axis] >> (8 * place))) & 255])
    crc = (crc >> 8) ^ np.int64(_STEPS[(crc ^ np.int64(data[1])) & 255])
    for place in range(_FIRST, length):
        crc = (crc >> 8) ^ np.int64(_STEPS[(crc ^ np.int64(data[place])) & 255])
    return crc ^ 0xFFFFFFFF


@lean_kernel
def _fill(tree, mean, precision):
    """Fill (V,) with what the leaves of a summary say that was opened."""
    size, leaf = tree.walk[0].size, tree.leaf[0]
    while read_leaf(tree):
        for i in range(leaf.low[0], leaf.high[0]):
            for j in range(leaf.low[1], leaf.high[1]):
                row = (i * size[1] + j) * size[2]
                for voxel in range(row + leaf.low[2], row + leaf.high[2]):
                    mean[voxel], precision[voxel] = leaf.mean, leaf.precision
