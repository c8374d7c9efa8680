"""Slow references of predictions: which voxels a cell overlaps by exact fractions, and the U-Net in NumPy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

import numpy as np

CELL = Fraction(1, 5)
CELLS, STEP, LEVELS = 128, 16, 4


def window(place_m: np.ndarray, corner_m: np.ndarray) -> tuple[int, int]:
    """First cells of a crop: the multiple of 16 that is nearest to the place, less half a crop."""
    from_corner = np.asarray(place_m)[:2] - np.asarray(corner_m)[:2]
    first = [math.floor(float(at) / float(CELL * STEP) + 0.5) * STEP - CELLS // 2 for at in from_corner]
    return first[0], first[1]


def overlapped(cell: int, voxel: Fraction, count: int) -> range:
    """Voxels along an axis that share more than a point with a cell."""
    low, high = cell * CELL, (cell + 1) * CELL
    return range(max(math.floor(low / voxel), 0), min(math.ceil(high / voxel), count))


def channels(
    mean: np.ndarray, measured: np.ndarray, voxel: Fraction, first: tuple[int, int], layers: range
) -> tuple[np.ndarray, np.ndarray]:
    """Shares of voxels measured as covered and as free, and outside; and the most coverage, else -1."""
    cells, solid = np.zeros((3, CELLS, CELLS)), np.full((CELLS, CELLS), -1.0)
    for i in range(CELLS):
        across = overlapped(first[0] + i, voxel, mean.shape[0])
        for j in range(CELLS):
            along = overlapped(first[1] + j, voxel, mean.shape[1])
            voxels = [(x, y, z) for x in across for y in along for z in layers]
            if not voxels:
                cells[2, i, j] = solid[i, j] = 1.0
                continue
            known = [float(mean[voxel]) for voxel in voxels if measured[voxel]]
            cells[0, i, j] = sum(each > 0.5 for each in known) / len(voxels)
            cells[1, i, j] = sum(each <= 0.5 for each in known) / len(voxels)
            solid[i, j] = max(known, default=-1.0)
    return cells, solid


def convolved(image: np.ndarray, weights: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """A convolution with zeros around the image, in float64: (O, H, W) from (I, H, W) and (O, I, K, K)."""
    reach, (height, width) = weights.shape[-1] // 2, image.shape[1:]
    padded = np.pad(image.astype(float), ((0, 0), (reach, reach), (reach, reach)))
    out = np.broadcast_to(bias[:, None, None], (len(bias), height, width)).astype(float)
    for a in range(weights.shape[-1]):
        for b in range(weights.shape[-1]):
            shifted = padded[:, a : a + height, b : b + width]
            out = out + np.einsum("oi,ihw->ohw", weights[:, :, a, b].astype(float), shifted)
    return out


def logits(tensors: Mapping[str, np.ndarray], cells: np.ndarray) -> np.ndarray:
    """The U-Net of `prediction.unet`: (N, N) from cells (3, N, N) and tensors as files name them."""

    def layer(name: str, image: np.ndarray) -> np.ndarray:
        return convolved(image, tensors[f"{name}.weight"], tensors[f"{name}.bias"])

    count, size = len(cells), cells.shape[1]
    blocks = cells.reshape(count, size // 2, 2, size // 2, 2).transpose(0, 2, 4, 1, 3)
    values, finer = blocks.reshape(4 * count, size // 2, size // 2), []
    for level in range(LEVELS):
        if level:
            channels, height, width = values.shape
            values = values.reshape(channels, height // 2, 2, width // 2, 2).max(axis=(2, 4))
        values = np.maximum(layer(f"first.{level}", values), 0.0)
        values = np.maximum(layer(f"second.{level}", values), 0.0)
        finer.append(values)
    for level in range(LEVELS - 2, -1, -1):
        lifted = layer(f"lift.{level}", values).repeat(2, axis=1).repeat(2, axis=2)
        values = np.maximum(layer(f"merge.{level}", finer[level] + lifted), 0.0)
    parts = layer("head", values).reshape(2, 2, size // 2, size // 2)
    return parts.transpose(2, 0, 3, 1).reshape(size, size)
