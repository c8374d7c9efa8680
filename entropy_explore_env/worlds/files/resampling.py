"""Resampling to another voxel size, by volumes such that thin walls stay solid."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.worlds.files.voxels import (
    FREE,
    FREE_AT_LEAST,
    OCCUPIED_BELOW,
    ROUNDING,
    SOLID,
    UNKNOWN,
    UNREADABLE,
    Voxels,
    checked_shape,
)


def resampled(voxels: Voxels, voxel_size_m: float | None) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the labels of voxels of a wanted size, and the ceiling counted in them.

    A voxel is free if at least half of it is known to be free and less than a quarter of it is solid; of the
    others it is solid if at least a quarter of it is, and unreadable where most of what is solid is. A plan
    stays one voxel high.

    Args:
        voxels: A file's content.
        voxel_size_m: The size; None = the file's own.

    Returns:
        (X′, Y′, Z′) int8 labels, and (X′, Y′) int32 ceiling or None: the lowest over each column, whole
        voxels.

    Raises:
        RefusedError: Too many voxels.
    """
    if voxel_size_m is None or abs(voxel_size_m - voxels.voxel_size_m) < 1e-9 * voxels.voxel_size_m:
        return voxels.labels, voxels.ceiling
    scale = voxel_size_m / voxels.voxel_size_m
    old = voxels.labels.shape
    plan = old[2] == 1
    extents = [n / scale for n in old]
    shape = checked_shape([*extents[:2], 1.0 if plan else extents[2]])
    pooled = np.empty(shape, np.int8)
    _pool(np.ascontiguousarray(voxels.labels), (scale, scale, 1.0 if plan else scale), pooled)
    if voxels.ceiling is None:
        return pooled, None
    ceiling = np.empty(shape[:2], np.int32)
    _lower(voxels.ceiling, scale, old[2], shape[2], ceiling)
    return pooled, ceiling


@lean_kernel
def _pool(labels, scale, pooled):
    """Label new voxels by the volumes of the old ones that they overlap.

    Args:
        labels: (X, Y, Z) int8.
        scale: Edges of a new voxel in old ones, along x, y and z.
        pooled: (X′, Y′, Z′) int8; filled.
    """
    volume = scale[0] * scale[1] * scale[2]
    for i in range(pooled.shape[0]):
        x_low, x_high = i * scale[0], (i + 1) * scale[0]
        for j in range(pooled.shape[1]):
            y_low, y_high = j * scale[1], (j + 1) * scale[1]
            for k in range(pooled.shape[2]):
                z_low, z_high = k * scale[2], (k + 1) * scale[2]
                free, occupied, unreadable = 0.0, 0.0, 0.0
                for x in range(int(x_low), min(labels.shape[0], math.ceil(x_high))):
                    across = min(x_high, x + 1.0) - max(x_low, float(x))
                    for y in range(int(y_low), min(labels.shape[1], math.ceil(y_high))):
                        area = across * (min(y_high, y + 1.0) - max(y_low, float(y)))
                        for z in range(int(z_low), min(labels.shape[2], math.ceil(z_high))):
                            part = area * (min(z_high, z + 1.0) - max(z_low, float(z)))
                            if labels[x, y, z] == FREE:
                                free += part
                            elif labels[x, y, z] != UNKNOWN:
                                occupied += part
                                unreadable += part if labels[x, y, z] == UNREADABLE else 0.0
                is_free = free >= (FREE_AT_LEAST - ROUNDING) * volume
                if occupied >= (OCCUPIED_BELOW - ROUNDING) * volume:
                    pooled[i, j, k] = UNREADABLE if unreadable > 0.5 * occupied else SOLID
                else:
                    pooled[i, j, k] = FREE if is_free else UNKNOWN


@lean_kernel
def _lower(ceiling, scale, none, new_none, lowered):
    """Fill in the lowest ceiling over each new column, in whole new voxels.

    Args:
        ceiling: (X, Y) int32, lowest layer of the no-fly zone; `none` = no such layer.
        scale: Edge of a new voxel in old ones.
        none: Layers of the old voxels.
        new_none: Layers of the new ones.
        lowered: (X′, Y′) int32; filled.
    """
    for i in range(lowered.shape[0]):
        for j in range(lowered.shape[1]):
            lowest = none
            for x in range(int(i * scale), min(ceiling.shape[0], math.ceil((i + 1) * scale))):
                for y in range(int(j * scale), min(ceiling.shape[1], math.ceil((j + 1) * scale))):
                    lowest = min(lowest, ceiling[x, y])
            lowered[i, j] = new_none if lowest == none else int(lowest / scale + ROUNDING)
