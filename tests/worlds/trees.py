"""OctoMap trees as large as those of real buildings, written straight from labelled voxels."""

from __future__ import annotations

from pathlib import Path

import numpy as np

_DEPTH = 16
UNKNOWN, FREE, SOLID = -1, 0, 1


def write_tree(path: Path, labels: np.ndarray, edge_m: float, low: tuple[int, int, int]) -> Path:
    """A pruned binary tree (`.bt`) of voxels (X, Y, Z), -1, 0 or 1, from `low` voxels on.

    An inner node is two bytes: for each of its eight children 1 = free, 2 = solid, 3 = an inner node. They
    follow each other depth first, which is the order of their first voxels along the Morton curve.
    """
    known = labels >= 0
    codes = _morton(np.argwhere(known) + np.asarray(low) + 2 ** (_DEPTH - 1))
    order = np.argsort(codes)
    codes, values = codes[order], np.where(labels[known][order] == SOLID, 2, 1)
    firsts, depths, words = [], [], []
    for depth in range(_DEPTH - 1, -1, -1):
        parents = codes >> 3
        begin = np.flatnonzero(np.r_[True, parents[1:] != parents[:-1]])
        word, parents = np.add.reduceat(values << (2 * (codes & 7)), begin), parents[begin]
        inner = (word != 0x5555) & (word != 0xAAAA)  # eight alike are one leaf
        firsts.append(parents[inner] << (3 * (_DEPTH - depth)))
        depths.append(np.full(int(inner.sum()), depth))
        words.append(word[inner])
        codes, values = parents, np.where(inner, 3, np.where(word == 0x5555, 1, 2))
    first, depth, word = (np.concatenate(each) for each in (firsts, depths, words))
    word = word[np.lexsort((depth, first))]
    nodes = 1 + sum(int(((word >> (2 * child)) & 3 != 0).sum()) for child in range(8))
    head = f"# Octomap OcTree binary file\nid OcTree\nsize {nodes}\nres {edge_m:g}\ndata\n"
    path.write_bytes(head.encode() + word.astype("<u2").tobytes())
    return path


def _morton(voxels: np.ndarray) -> np.ndarray:
    """(N,) int64 places of voxels (N, 3) along the Morton curve, x in the lowest bits."""
    codes = np.zeros(len(voxels), np.int64)
    for axis in range(3):
        for bit in range(_DEPTH):
            codes |= ((voxels[:, axis].astype(np.int64) >> bit) & 1) << (3 * bit + axis)
    return codes


def building(shape: tuple[int, int, int], seed: int, rooms: int, speckle: float) -> np.ndarray:
    """(X, Y, Z) int8: rooms seen from inside, unknown space between them, stray voxels of both kinds."""
    rng = np.random.default_rng(seed)
    labels, (x, y, z) = np.full(shape, UNKNOWN, np.int8), shape
    for _ in range(rooms):
        wide, deep = int(rng.integers(x // 10, x // 3)), int(rng.integers(y // 8, y // 2))
        i, j = int(rng.integers(0, x - wide)), int(rng.integers(0, y - deep))
        room = labels[i : i + wide, j : j + deep, z // 10 : z - z // 10]
        room[...] = FREE
        room[[0, -1]] = SOLID
        room[:, [0, -1]] = SOLID
        room[:, :, 0] = SOLID
    stray = rng.random(shape, np.float32)
    labels[(stray < speckle) & (labels == FREE)] = UNKNOWN
    labels[(stray > 1.0 - speckle / 4) & (labels == FREE)] = SOLID
    labels[0, 0, 0] = labels[-1, -1, -1] = FREE
    return labels
