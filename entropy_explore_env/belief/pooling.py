"""A belief pooled to a coarse grid of cells, carried along as rays change it: entropy and coverage.

Normalised entropy is 1 at the prior and 0 at the voxel entropy that ends a mission, clipped in between.
A cell holds sums over its voxels; whoever wants means divides by how many there are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.map_update import PRIOR_MEAN, fuse_ray
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel


class Cells(NamedTuple):
    """Which voxels lie in which of C cells."""

    size: tuple[int, int, int]
    """(X, Y, Z) voxels."""
    x: np.ndarray
    """(X,) int64: a voxel's cell is x[i] + y[j] + z[k]."""
    y: np.ndarray
    z: np.ndarray
    voxels: np.ndarray
    """(C,) float64, how many voxels a cell has."""


def new_cells(size: tuple[int, int, int], shape: tuple[int, int, int]) -> Cells:
    """Cells that cut each axis into as equal parts as whole voxels allow.

    Args:
        size: (X, Y, Z) voxels.
        shape: Cells along each axis, at most the voxels.
    """
    # Voxel v lies in cell i where i·V // C <= v < (i + 1)·V // C.
    axes = [((np.arange(v) + 1) * c - 1) // v for v, c in zip(size, shape, strict=True)]
    counts = [np.bincount(axis, minlength=c) for axis, c in zip(axes, shape, strict=True)]
    voxels = counts[0][:, None, None] * counts[1][:, None] * counts[2]
    return Cells(
        size, axes[0] * shape[1] * shape[2], axes[1] * shape[2], axes[2], voxels.ravel().astype(float)
    )


def fresh_sums(cells: Cells) -> np.ndarray:
    """(2, C) float64 sums of a belief that nothing has measured: normalised entropy, coverage."""
    return np.stack([cells.voxels, PRIOR_MEAN * cells.voxels])


@inlined_kernel
def normalised_entropy(prior_precision, end_precision, precision):
    """1 at the prior, 0 at the voxel entropy that ends a mission, clipped in between."""
    span = math.log2(end_precision / prior_precision)
    return min(max(math.log2(end_precision / precision) / span, 0.0), 1.0)


@lean_kernel
def pool_belief(cells, sums, ends, mean, precision):
    """Fill the sums of a whole belief.

    Args:
        cells: The Cells.
        sums: (2, C) float64, filled in.
        ends: (prior, end) precision between which entropy is normalised.
        mean: (V,) float32.
        precision: (V,) float32.
    """
    for cell in range(sums.shape[1]):
        sums[0, cell] = sums[1, cell] = 0.0
    voxel = 0
    for i in range(cells.size[0]):
        for j in range(cells.size[1]):
            for k in range(cells.size[2]):
                cell = cells.x[i] + cells.y[j] + cells.z[k]
                sums[0, cell] += normalised_entropy(ends[0], ends[1], np.float64(precision[voxel]))
                sums[1, cell] += np.float64(mean[voxel])
                voxel += 1


@lean_kernel
def fuse_pooled_ray(cells, sums, ends, mean, precision, crossed, coverage, free, n, measured):
    """Like `fuse_ray`; the sums of the cells that the ray crosses follow.

    Args:
        cells: The Cells.
        sums: (2, C) float64, changed in place.
        ends: (prior, end) precision between which entropy is normalised.
        mean: (V,) float32; the rest as in `fuse_ray`.
        precision: (V,) float32.
        crossed: (L,) int32.
        coverage: (L,) float32.
        free: Leading voxels that measure 0.
        n: Crossed voxels.
        measured: Precision of the measurement.

    Returns:
        Utility in bits, ≥ 0.
    """
    _pool_ray(cells, sums, ends, mean, precision, crossed, n, -1.0)
    bits = fuse_ray(mean, precision, crossed, coverage, free, n, measured)
    _pool_ray(cells, sums, ends, mean, precision, crossed, n, 1.0)
    return bits


@inlined_kernel
def _pool_ray(cells, sums, ends, mean, precision, crossed, n, sign):
    """Add (sign 1) or take away (-1) what the voxels of a ray contribute to their cells."""
    size_y, size_z = cells.size[1], cells.size[2]
    for i in range(n):
        voxel = crossed[i]
        column = voxel // size_z
        cell = cells.x[column // size_y] + cells.y[column % size_y] + cells.z[voxel - column * size_z]
        sums[0, cell] += sign * normalised_entropy(ends[0], ends[1], np.float64(precision[voxel]))
        sums[1, cell] += sign * np.float64(mean[voxel])
