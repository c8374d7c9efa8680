"""OctoMap trees without OctoMap: the nodes of `octomap_msgs/Octomap`, and of files behind their head.

Nodes follow each other depth first, and child i lies at the upper half of x, y and z by the bits 1, 2 and 4
of i. In the binary form every inner node is two bytes, two bits of them for each child: 0 unknown, 1 free, 2
solid, 3 inner. In the full form every node is a float32, its log-odds, and a byte, a bit of it for each
child.
"""

from __future__ import annotations

import struct

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.worlds.files.octomap_tree import Leaves, own_labels
from entropy_explore_env.worlds.files.voxels import FREE, SOLID

_DEPTH = 16
_MOST_VOXELS = 1 << 27
"""A tree may say that a few bytes fill the world."""


def voxels_of_tree(data: bytes, binary: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the labels (X, Y, Z) int8 of a tree's box, and its lower corner (3,) in voxels from the origin.

    Raises:
        SettingError: The bytes end too early, the tree is empty or too deep, or its box has too many voxels.
    """
    try:
        leaves = _binary_leaves(data) if binary else _full_leaves(data)
    except (IndexError, struct.error):
        raise SettingError("octomap.data", f"{len(data)} bytes", "a whole tree") from None
    if not leaves:
        raise SettingError("octomap.data", f"{len(data)} bytes", "a tree of which something is known")
    table = np.array(leaves, np.int64)
    corners, widths, solid = table[:, :3], table[:, 3], table[:, 4] == SOLID
    low, high = corners.min(axis=0), (corners + widths[:, None]).max(axis=0)
    if np.prod((high - low).astype(float)) > _MOST_VOXELS:
        raise SettingError("octomap.data", (high - low).tolist(), f"a box of at most {_MOST_VOXELS} voxels")
    x, y, z = (high - low).tolist()
    return own_labels(Leaves(corners - low, widths, solid), (x, y, z)), low


def _children_of(corner: tuple[int, int, int], width: int) -> list[tuple[int, int, int]]:
    """Return the lower corners of a cube's eighths, which are `width` voxels wide."""
    x, y, z = corner
    return [(x + width * (i & 1), y + width * (i >> 1 & 1), z + width * (i >> 2 & 1)) for i in range(8)]


def _root() -> tuple[tuple[int, int, int], int]:
    """Return the lower corner and the edge of a whole tree."""
    half = 1 << (_DEPTH - 1)
    return (-half, -half, -half), 2 * half


def _binary_leaves(data: bytes) -> list[tuple[int, int, int, int, int]]:
    """Return x, y, z, width and label of each leaf."""
    leaves, at, waiting = [], 0, [_root()]
    while waiting:
        corner, width = waiting.pop()
        width //= 2
        if width == 0:
            raise IndexError
        states = data[at] | data[at + 1] << 8
        at, inner = at + 2, []
        for number, child in enumerate(_children_of(corner, width)):
            state = states >> 2 * number & 3
            if state == 3:
                inner.append((child, width))
            elif state:
                leaves.append((*child, width, FREE if state == 1 else SOLID))
        waiting += reversed(inner)
    return leaves


def _full_leaves(data: bytes) -> list[tuple[int, int, int, int, int]]:
    """Return x, y, z, width and label of each leaf; solid from log-odds of 0 on."""
    leaves, at, waiting = [], 0, [_root()]
    while waiting:
        corner, width = waiting.pop()
        log_odds, mask = struct.unpack_from("<fB", data, at)
        at += 5
        if mask == 0:
            leaves.append((*corner, width, SOLID if log_odds >= 0.0 else FREE))
            continue
        if width == 1:
            raise IndexError
        children = _children_of(corner, width // 2)
        waiting += [(children[i], width // 2) for i in reversed(range(8)) if mask >> i & 1]
    return leaves
