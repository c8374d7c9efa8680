"""OctoMap trees (Hornung et al. 2013): files `.bt` and `.ot`, and the nodes in messages of ROS.

A node is solid from log-odds of 0 on; space that no leaf covers is unknown. Of trees with colours or times
(ColorOcTree, OcTreeStamped) only the occupancy is read. The leaves are summed up in voxels of the wanted
size, a slab of the map after the other: memory follows the result, and the grid of the tree's own resolution
is never made. octomap-python is not used: where a file ends too early, it makes nodes of what it finds in
memory.
"""

from __future__ import annotations

import math
import re
import struct
from array import array
from pathlib import Path
from typing import NamedTuple

import numpy as np

from entropy_explore_env.worlds.files.voxels import (
    FREE,
    FREE_AT_LEAST,
    OCCUPIED_BELOW,
    ROUNDING,
    SOLID,
    UNKNOWN,
    Options,
    RefusedError,
    Voxels,
    checked_shape,
    content,
)

NEEDS = ()
_KNOWN = "an OctoMap whose id is OcTree, OcTreeStamped or ColorOcTree"
_RECORDS = {b"OcTree": 5, b"1": 5, b"OcTreeStamped": 5, b"ColorOcTree": 8}
"""Id of a tree, "1" in old files → bytes of a node in an .ot: its occupancy, a colour, its children."""
_DATA_LINE = re.compile(rb"\r?\ndata[ \t]*\r?\n")
_BINARY_FILE, _FULL_FILE = b"# Octomap OcTree binary file", b"# Octomap OcTree file"
_SIZED = "an OctoMap with a resolution > 0 and finite bounds"
_DEPTH = 16
"""Levels below the root."""
_WHOLE = f"a whole OctoMap tree of at most {_DEPTH} levels below its root"
_INNER = 3
"""State of a child that has children of its own; 1 is free, 2 solid, 0 unknown."""
_VOXELS_PER_BYTE = 4096
"""Limit of the voxels for each byte of the file: a leaf, at least two bits, may cover many."""
_LEAVES_AT_ONCE = 1 << 16
_SLAB_VOXELS = 1 << 21
"""Voxels of a slab, in which leaves are summed up."""


class Leaves(NamedTuple):
    """The N leaves of a tree: cubes, in voxels of its own resolution."""

    corner: np.ndarray
    """(N, 3) whole numbers, lower corner."""
    width: np.ndarray
    """(N,) whole numbers, edge."""
    solid: np.ndarray
    """(N,) bool; the others are free."""

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """The lower and the upper corner (3,) of the box around all leaves."""
        return self.corner.min(axis=0), (self.corner + self.width[:, None]).max(axis=0)


def read(path: Path, options: Options) -> Voxels:
    """Return the tree's voxels at the wanted size, or at its own resolution."""
    data = content(path)
    binary = data.startswith(_BINARY_FILE)
    size, edge, body = _head_and_body(data, binary)
    leaves, nodes = leaves_of(body, binary)
    if nodes != size:
        raise RefusedError(f"an OctoMap tree of as many nodes as its head says; there are {nodes}")
    first, last = leaves.box
    edges = leaves.width[:, None] * edge
    low = ((leaves.corner / leaves.width[:, None] + 0.5) * edges - edges / 2.0).min(axis=0)
    if not np.isfinite([low, low + (last - first) * edge]).all():
        raise RefusedError(_SIZED)
    voxel_m = options.get("voxel_size_m")
    wanted_m = edge if voxel_m is None else float(voxel_m)
    own = abs(wanted_m - edge) < 1e-9 * edge
    scale = 1.0 if own else wanted_m / edge
    shape = checked_shape((last - first) / scale)
    if np.prod(shape) > 1_000_000 + _VOXELS_PER_BYTE * len(data):
        raise RefusedError(f"an OctoMap whose box holds at most {_VOXELS_PER_BYTE} voxels a byte")
    leaves = leaves._replace(corner=leaves.corner - first)
    labels = own_labels(leaves, shape) if own else _summed_labels(leaves, scale, shape)
    return Voxels(labels, edge if own else wanted_m, (float(low[0]), float(low[1]), float(low[2])))


def _head_and_body(data: bytes, binary: bool) -> tuple[int, float, bytes]:
    """Return the number of nodes and the resolution that a file states, and its nodes without colours."""
    found = _DATA_LINE.search(data)
    if found is None or not (binary or data.startswith(_FULL_FILE)):
        raise RefusedError(_WHOLE)
    head, body = data[: found.start()], data[found.end() :]
    rows = (line.split() for line in head.splitlines() if not line.startswith(b"#"))
    about = {row[0]: row[1] for row in rows if len(row) > 1}
    kind = about.get(b"id", b"")
    if kind not in _RECORDS:
        raise RefusedError(_KNOWN)
    try:
        size, edge = int(about.get(b"size", b"0")), float(about.get(b"res", b"0"))
    except ValueError:
        raise RefusedError("an OctoMap whose size and res are numbers") from None
    if not 0.0 < edge < math.inf:
        raise RefusedError(_SIZED)
    return size, edge, body if binary else without_colours(body, kind)


def without_colours(body: bytes, kind: bytes) -> bytes:
    """Return the nodes of a tree in the full form as those of an OcTree.

    Args:
        body: The nodes.
        kind: The tree's id.

    Raises:
        RefusedError: Trees of this kind are not read.
    """
    if kind not in _RECORDS:
        raise RefusedError(_KNOWN)
    record = _RECORDS[kind]
    if record == _RECORDS[b"OcTree"]:
        return body
    nodes = np.frombuffer(body, np.uint8, len(body) // record * record).reshape(-1, record)
    return nodes[:, [0, 1, 2, 3, record - 1]].tobytes()


def leaves_of(body: bytes, binary: bool) -> tuple[Leaves, int]:
    """Return the leaves of a tree, in voxels from its middle, and the number of its nodes.

    Nodes follow each other depth first, and child i lies at the upper half of x, y and z by the bits 1, 2 and
    4 of i. In the binary form every inner node is two bytes, two bits for the state of each child. In the
    full form every node is a float32, its log-odds, and a byte, a bit of it for each child. An inner node
    without children counts as free. What follows the tree is left alone.

    Raises:
        RefusedError: The bytes end too early, or the tree is too deep.
    """
    table, nodes, at, record = array("i"), 1, 0, 2 if binary else 5
    half = 1 << (_DEPTH - 1)
    waiting = [(-half, -half, -half, 2 * half)]
    while waiting:
        x, y, z, width = waiting.pop()
        if at + record > len(body):
            raise RefusedError(_WHOLE)
        if binary:
            states, solid = body[at] | body[at + 1] << 8, False
        else:
            log_odds, mask = struct.unpack_from("<fB", body, at)
            states, solid = _STATES_OF_MASK[mask], log_odds >= 0.0
        at, half = at + record, width // 2
        if half == 0 and (binary or states):
            raise RefusedError(_WHOLE)
        if states == 0:
            table.extend((x, y, z, width, solid))
        for child in range(7, -1, -1):  # the first one is popped first
            state = states >> 2 * child & 3
            if state:
                nodes += 1
                cube = (x + half * (child & 1), y + half * (child >> 1 & 1), z + half * (child >> 2), half)
                if state == _INNER:
                    waiting.append(cube)
                else:
                    table.extend((*cube, state == 2))
    rows = np.frombuffer(table, np.intc).reshape(-1, 5)
    return Leaves(rows[:, :3], rows[:, 3], rows[:, 4] > 0), nodes


_STATES_OF_MASK = [
    sum(_INNER << 2 * child for child in range(8) if mask >> child & 1) for mask in range(1 << 8)
]
"""Which children a node of the full form has → their states."""


def own_labels(leaves: Leaves, shape: tuple[int, int, int]) -> np.ndarray:
    """Return (X, Y, Z) int8 labels at the tree's own resolution."""
    labels = np.full(shape, UNKNOWN, np.int8)
    label = np.where(leaves.solid, SOLID, FREE).astype(np.int8)
    single = leaves.width == 1
    labels[tuple(leaves.corner[single].T)] = label[single]
    large = ~single
    for (x, y, z), w, value in zip(leaves.corner[large], leaves.width[large], label[large], strict=True):
        labels[x : x + w, y : y + w, z : z + w] = value
    return labels


def _summed_labels(leaves: Leaves, scale: float, shape: tuple[int, int, int]) -> np.ndarray:
    """Return (X, Y, Z) int8 labels of voxels `scale` own ones wide, by the volumes of leaves.

    By the rule of `resampling`.
    """
    labels = np.empty(shape, np.int8)
    deep = max(1, _SLAB_VOXELS // (shape[1] * shape[2]))
    for first in range(0, shape[0], deep):
        last = min(first + deep, shape[0])
        volumes = np.zeros((2, last - first, *shape[1:]))
        begin, end = leaves.corner[:, 0] / scale, (leaves.corner[:, 0] + leaves.width) / scale
        inside = (end > first) & (begin < last)
        for solid in (False, True):
            chosen = np.flatnonzero(inside & (leaves.solid == solid))
            for place in range(0, len(chosen), _LEAVES_AT_ONCE):
                some = chosen[place : place + _LEAVES_AT_ONCE]
                _add_volumes(volumes[int(solid)], leaves.corner[some], leaves.width[some], scale, first)
        free = volumes[0] >= FREE_AT_LEAST - ROUNDING
        solid = volumes[1] >= OCCUPIED_BELOW - ROUNDING
        labels[first:last] = np.where(solid, SOLID, np.where(free, FREE, UNKNOWN))
    return labels


def _add_volumes(
    volumes: np.ndarray, corner: np.ndarray, width: np.ndarray, scale: float, first: int
) -> None:
    """Add to each voxel of a slab the share of its volume that cubes overlap.

    Args:
        volumes: (S, Y, Z) float64; changed in place. The slab begins at voxel `first` along x.
        corner: (N, 3) of cubes that no two overlap, in own voxels.
        width: (N,) their edges.
        scale: Edge of a voxel in own ones.
        first: Along x.
    """
    low = corner / scale
    low[:, 0] -= first
    high = low + (width / scale)[:, None]
    np.clip(low, 0.0, volumes.shape, out=low)
    np.clip(high, 0.0, volumes.shape, out=high)
    begin = np.minimum(low.astype(np.int64), np.array(volumes.shape) - 1)
    steps = np.ceil(high).astype(np.int64) - begin  # voxels that a cube overlaps along each axis
    for count in np.unique(steps, axis=0):
        alike = (steps == count).all(axis=1)
        if np.prod(count) > 27:
            _add_large(volumes, low[alike], high[alike], begin[alike], count)
            continue
        for step in np.ndindex(*count):
            at = begin[alike] + step
            sides = np.minimum(high[alike], at + 1) - np.maximum(low[alike], at)
            flat = (at[:, 0] * volumes.shape[1] + at[:, 1]) * volumes.shape[2] + at[:, 2]
            np.add.at(volumes.reshape(-1), flat, np.maximum(sides, 0.0).prod(axis=1))


def _add_large(
    volumes: np.ndarray, low: np.ndarray, high: np.ndarray, begin: np.ndarray, count: np.ndarray
) -> None:
    """Do what `_add_volumes` does cube by cube, for cubes over many voxels."""
    for a, b, at in zip(low, high, begin, strict=True):
        sides = [
            np.minimum(b[axis], (cells := at[axis] + np.arange(count[axis])) + 1) - np.maximum(a[axis], cells)
            for axis in range(3)
        ]
        block = tuple(slice(at[axis], at[axis] + count[axis]) for axis in range(3))
        volumes[block] += np.einsum("i,j,k->ijk", *(np.maximum(side, 0.0) for side in sides))
