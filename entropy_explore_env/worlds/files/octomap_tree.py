"""OctoMap trees (Hornung et al. 2013), `.bt` and `.ot`, read with octomap-python.

A node is solid from the tree's own occupancy threshold on; space that no leaf covers is unknown. Of trees
with colours or times (ColorOcTree, OcTreeStamped) only the occupancy is read. The leaves are summed up in
voxels of the wanted size, a slab of the map after the other: memory follows the result, and the grid of the
tree's own resolution is never made.
"""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path
from typing import Any, NamedTuple

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

NEEDS = (("octomap", "octomap-python"),)
_RECORDS = {b"OcTree": 5, b"1": 5, b"OcTreeStamped": 5, b"ColorOcTree": 8}
"""Id of a tree, "1" in old files → bytes of a node in an .ot: its occupancy, a colour, its children."""
_DATA_LINE = re.compile(rb"\r?\ndata[ \t]*\r?\n")
_BINARY_FILE, _FULL_FILE = b"# Octomap OcTree binary file", b"# Octomap OcTree file"
_SIZED = "an OctoMap with a resolution > 0 and finite bounds"
_DEPTH = 16
"""Levels below the root."""
_VOXELS_PER_BYTE = 4096
"""Limit of the voxels for each byte of the file: a leaf, at least two bits, may cover many."""
_LEAVES_AT_ONCE = 1 << 16
_SLAB_VOXELS = 1 << 21
"""Voxels of a slab, in which leaves are summed up."""


class Leaves(NamedTuple):
    """The N leaves of a tree: cubes, in voxels of its own resolution from its lower corner."""

    corner: np.ndarray
    """(N, 3) whole numbers, lower corner."""
    width: np.ndarray
    """(N,) whole numbers, edge."""
    solid: np.ndarray
    """(N,) bool; the others are free."""


def read(path: Path, options: Options) -> Voxels:
    """Return the tree's voxels at the wanted size, or at its own resolution."""
    data = content(path)
    tree = _tree(data)
    edge = float(tree.getResolution())
    low, high = np.array(tree.getMetricMin()), np.array(tree.getMetricMax())
    if not (edge > 0 and np.isfinite(low).all() and np.isfinite(high).all()):
        raise RefusedError(_SIZED)
    extent = np.rint((high - low) / edge)
    if (extent < 1).any():
        raise RefusedError(_SIZED)
    voxel_m = options.get("voxel_size_m")
    wanted_m = edge if voxel_m is None else float(voxel_m)
    own = abs(wanted_m - edge) < 1e-9 * edge
    scale = 1.0 if own else wanted_m / edge
    shape = checked_shape(extent / scale)
    if np.prod(shape) > 1_000_000 + _VOXELS_PER_BYTE * len(data):
        raise RefusedError(f"an OctoMap whose box holds at most {_VOXELS_PER_BYTE} voxels a byte")
    leaves = _leaves(tree, low, edge, extent)
    del tree
    labels = own_labels(leaves, shape) if own else _summed_labels(leaves, scale, shape)
    return Voxels(labels, edge if own else wanted_m, (float(low[0]), float(low[1]), float(low[2])))


def _tree(data: bytes) -> Any:  # noqa: ANN401 - octomap has no types
    """Return the tree in the bytes, whose nodes are counted before octomap reads them.

    Where a file ends too early, octomap makes nodes of what it finds in its memory, at any depth, until there
    is no more of it. So it is given the nodes that are there, under a head of our own.
    """
    import octomap

    binary = data.startswith(_BINARY_FILE)
    if not binary and not data.startswith(_FULL_FILE):
        raise RefusedError("a whole OctoMap tree")
    size, edge, body = _head_and_body(data, binary)
    nodes, used = _counted_nodes(body, binary)
    if nodes != size:
        raise RefusedError(f"an OctoMap tree of as many nodes as its head says; there are {nodes}")
    first = _BINARY_FILE if binary else _FULL_FILE
    whole = b"%s\nid OcTree\nsize %d\nres %s\ndata\n%s" % (first, size, repr(edge).encode(), body[:used])
    if not binary:
        return octomap.OcTree.read(whole)
    tree = octomap.OcTree(1.0)
    if not tree.readBinary(whole):
        raise RefusedError("a whole OctoMap tree")
    return tree


def _head_and_body(data: bytes, binary: bool) -> tuple[int, float, bytes]:
    """Return the number of nodes and the resolution that a file states, and its nodes without colours."""
    found = _DATA_LINE.search(data)
    if found is None:
        raise RefusedError("a whole OctoMap tree")
    head, body = data[: found.start()], data[found.end() :]
    rows = (line.split() for line in head.splitlines() if not line.startswith(b"#"))
    about = {row[0]: row[1] for row in rows if len(row) > 1}
    record = _RECORDS.get(about.get(b"id", b""))
    if record is None:
        raise RefusedError("an OctoMap whose id is OcTree, OcTreeStamped or ColorOcTree")
    try:
        size, edge = int(about.get(b"size", b"0")), float(about.get(b"res", b"0"))
    except ValueError:
        raise RefusedError("an OctoMap whose size and res are numbers") from None
    if not 0.0 < edge < math.inf:
        raise RefusedError(_SIZED)
    if record > _RECORDS[b"OcTree"] and not binary:
        nodes = np.frombuffer(body, np.uint8, len(body) // record * record).reshape(-1, record)
        body = nodes[:, [0, 1, 2, 3, record - 1]].tobytes()
    return size, edge, body


def _counted_nodes(body: bytes, binary: bool) -> tuple[int, int]:
    """How many nodes a tree has, and how many bytes hold them.

    Nodes follow each other depth first. A binary file has two bytes for every inner node, two bits of them
    for each child: none, free, solid or inner. The other kind has a float and a byte for every node, a bit of
    it for each child. A tree ends where no child is left to come.
    """
    if binary:
        words = np.frombuffer(body, "<u2", len(body) // 2)
        pairs = (words[:, None] >> np.arange(0, 16, 2)) & 3
        stored_children, children = (pairs == 3).sum(axis=1), (pairs > 0).sum(axis=1)
        record = 2
    else:
        masks = np.frombuffer(body, np.uint8, len(body) // 5 * 5)[4::5]
        stored_children = children = np.unpackbits(masks[:, None], axis=1).sum(axis=1)
        record = 5
    to_come = 1 + np.cumsum(stored_children.astype(np.int64) - 1)
    ends = np.flatnonzero(to_come == 0)
    if len(ends) == 0:
        raise RefusedError("a whole OctoMap tree")
    count = int(ends[0]) + 1
    if _levels(stored_children[:count].tolist()) > (_DEPTH if binary else _DEPTH + 1):
        raise RefusedError(f"an OctoMap tree of at most {_DEPTH} levels below its root")
    return 1 + int(children[:count].sum()), count * record


def _levels(children: list[int]) -> int:
    """How many levels nodes have that follow each other depth first, from each one's number of children."""
    to_come, most = [1], 1
    for count in children:
        to_come[-1] -= 1
        if count:
            to_come.append(count)
            most = max(most, len(to_come))
        while to_come and to_come[-1] == 0:
            to_come.pop()
    return most


def _leaves(tree: Any, low: np.ndarray, edge: float, extent: np.ndarray) -> Leaves:  # noqa: ANN401
    """All leaves, every one a cube of 2^(16 - depth) voxels, in a compact form: 17 bytes each."""
    rows = (
        (leaf.getX(), leaf.getY(), leaf.getZ(), leaf.getDepth(), tree.isNodeOccupied(leaf))
        for leaf in tree.begin_leafs()
    )
    parts = []
    while some := list(itertools.islice(rows, _LEAVES_AT_ONCE)):
        table = np.array(some, np.float64)
        width = np.left_shift(1, _DEPTH - table[:, 3].astype(np.int64))
        corner = np.rint((table[:, :3] - low) / edge - 0.5 * width[:, None])
        if not ((corner >= 0).all() and (corner + width[:, None] <= extent).all()):
            raise RefusedError("an OctoMap whose leaves lie inside its bounds")
        parts.append(Leaves(corner.astype(np.int32), width.astype(np.int32), table[:, 4] > 0.5))
    if not parts:
        raise RefusedError("a whole OctoMap tree")
    return Leaves(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def own_labels(leaves: Leaves, shape: tuple[int, int, int]) -> np.ndarray:
    """(X, Y, Z) int8 labels at the tree's own resolution."""
    labels = np.full(shape, UNKNOWN, np.int8)
    label = np.where(leaves.solid, SOLID, FREE).astype(np.int8)
    single = leaves.width == 1
    labels[tuple(leaves.corner[single].T)] = label[single]
    large = ~single
    for (x, y, z), w, value in zip(leaves.corner[large], leaves.width[large], label[large], strict=True):
        labels[x : x + w, y : y + w, z : z + w] = value
    return labels


def _summed_labels(leaves: Leaves, scale: float, shape: tuple[int, int, int]) -> np.ndarray:
    """(X, Y, Z) int8 labels of voxels `scale` own ones wide, by the volumes of leaves.

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
    """As `_add_volumes`, cube by cube, for cubes over many voxels."""
    for a, b, at in zip(low, high, begin, strict=True):
        sides = [
            np.minimum(b[axis], (cells := at[axis] + np.arange(count[axis])) + 1) - np.maximum(a[axis], cells)
            for axis in range(3)
        ]
        block = tuple(slice(at[axis], at[axis] + count[axis]) for axis in range(3))
        volumes[block] += np.einsum("i,j,k->ijk", *(np.maximum(side, 0.0) for side in sides))
