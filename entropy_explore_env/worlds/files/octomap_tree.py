"""OctoMap trees (Hornung et al. 2013), `.bt` and `.ot`, read with octomap-python.

A node is solid from the tree's own occupancy threshold on; space that no leaf covers is unknown.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.worlds.files.voxels import (
    FREE,
    SOLID,
    UNKNOWN,
    Options,
    RefusedError,
    Voxels,
    checked_shape,
    content,
)

NEEDS = (("octomap", "octomap-python"),)
_DEPTH = 16
_VOXELS_PER_BYTE = 4096
"""Limit of the voxels for each byte of the file: a leaf, at least two bits, may cover many."""


def read(path: Path, options: Options) -> Voxels:
    """The tree's voxels at its own resolution."""
    del options
    data = content(path)
    tree = _tree(data)
    edge = tree.getResolution()
    low, high = np.array(tree.getMetricMin()), np.array(tree.getMetricMax())
    if not (edge > 0 and np.isfinite(low).all() and np.isfinite(high).all()):
        raise RefusedError("an OctoMap with a resolution > 0 and finite bounds")
    extent = np.rint((high - low) / edge)
    if (extent < 1).any():
        raise RefusedError("an OctoMap with a resolution > 0 and finite bounds")
    shape = checked_shape(extent)
    if np.prod(shape) > 1_000_000 + _VOXELS_PER_BYTE * len(data):
        raise RefusedError(f"an OctoMap whose box holds at most {_VOXELS_PER_BYTE} voxels a byte")
    return Voxels(_labels(tree, low, edge, shape), float(edge), (float(low[0]), float(low[1]), float(low[2])))


def _tree(data: bytes) -> Any:  # noqa: ANN401 - octomap has no types
    """The tree in the bytes; truncated ones are refused, since the C++ reader fills in zeros."""
    import octomap

    binary = data.startswith(b"# Octomap OcTree binary file")
    if not binary and not data.startswith(b"# Octomap OcTree file"):
        raise RefusedError("a whole OctoMap tree")
    tree = octomap.OcTree.read(data) if not binary else _binary_tree(octomap, data)
    _, _, body = data.partition(b"\ndata\n")
    inner = tree.size() - tree.getNumLeafNodes()
    stored = 2 * inner if binary else 5 * tree.size()  # a float and a byte of children for every node
    if tree.size() == 0 or stored > len(body):
        raise RefusedError("a whole OctoMap tree")
    return tree


def _binary_tree(octomap: Any, data: bytes) -> Any:  # noqa: ANN401 - octomap has no types
    tree = octomap.OcTree(1.0)
    if not tree.readBinary(data):
        raise RefusedError("a whole OctoMap tree")
    return tree


def _labels(tree: Any, low: np.ndarray, edge: float, shape: tuple[int, int, int]) -> np.ndarray:  # noqa: ANN401
    """(X, Y, Z) int8: every leaf is a cube of 2^(16 - depth) voxels."""
    leaves = [
        (leaf.getX(), leaf.getY(), leaf.getZ(), leaf.getDepth(), tree.isNodeOccupied(leaf))
        for leaf in tree.begin_leafs()
    ]
    table = np.array(leaves, np.float64).reshape(-1, 5)
    width = np.left_shift(1, _DEPTH - table[:, 3].astype(np.int64))
    corner = np.rint((table[:, :3] - low) / edge - 0.5 * width[:, None]).astype(np.int64)
    label = np.where(table[:, 4] > 0.5, SOLID, FREE).astype(np.int8)
    if not ((corner >= 0).all() and (corner + width[:, None] <= shape).all()):
        raise RefusedError("an OctoMap whose leaves lie inside its bounds")
    labels = np.full(shape, UNKNOWN, np.int8)
    single = width == 1
    labels[tuple(corner[single].T)] = label[single]
    for (x, y, z), w, value in zip(corner[~single], width[~single], label[~single], strict=True):
        labels[x : x + w, y : y + w, z : z + w] = value
    return labels
