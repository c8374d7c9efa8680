"""Slow references of predictions: which voxels a cell overlaps by exact fractions, and the U-Net in NumPy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

import numpy as np

CELL = Fraction(1, 5)
CELLS, STEP, LEVELS = 128, 16, 4


def window(
    place_m: np.ndarray, corner_m: np.ndarray, edge: Fraction = CELL, cells: int = CELLS
) -> tuple[int, int]:
    """First cells of a crop: the multiple of 16 that is nearest to the place, less half a crop."""
    from_corner = np.asarray(place_m)[:2] - np.asarray(corner_m)[:2]
    first = [math.floor(float(at) / float(edge * STEP) + 0.5) * STEP - cells // 2 for at in from_corner]
    return first[0], first[1]


def overlapped(cell: int, voxel: Fraction, count: int, edge: Fraction = CELL) -> range:
    """Voxels along an axis that share more than a point with a cell."""
    low, high = cell * edge, (cell + 1) * edge
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


def volume_channels(
    mean: np.ndarray, measured: np.ndarray, voxel: Fraction, first: tuple[int, int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Channels of 32 layers of 64 × 64 cells of 0.4 m, and which of the cells hold no measured voxel."""
    cells, unknown = np.zeros((65, 64, 64)), np.zeros((32, 64, 64), bool)
    spans = [
        [overlapped(start + n, voxel, count, 2 * CELL) for n in range(cells_along)]
        for start, count, cells_along in zip(first, mean.shape, (64, 64, 32), strict=True)
    ]
    for i, across in enumerate(spans[0]):
        for j, along in enumerate(spans[1]):
            if not across or not along:
                cells[64, i, j] = 1.0
                continue
            for k, up in enumerate(spans[2]):
                known = [float(mean[x, y, z]) for x in across for y in along for z in up if measured[x, y, z]]
                voxels = len(across) * len(along) * len(up)
                cells[k, i, j] = sum(each > 0.5 for each in known) / voxels if voxels else 1.0
                cells[32 + k, i, j] = sum(each <= 0.5 for each in known) / voxels if voxels else 0.0
                unknown[k, i, j] = voxels > 0 and not known
    return cells, unknown


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
    """The U-Net of `prediction.unet`: (L, N, N) from cells (2·L + 1, N, N) and tensors as files name them."""

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
    parts = layer("head", values).reshape(-1, 2, 2, size // 2, size // 2)
    return parts.transpose(0, 3, 1, 4, 2).reshape(-1, size, size)
