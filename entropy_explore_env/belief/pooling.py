"""A belief pooled to a coarse grid of cells, carried along as rays change it: entropy and coverage.

Normalised entropy is 1 at the prior and 0 at the voxel entropy that ends a mission, clipped in between.
A cell holds sums over its voxels; means are these divided by how many there are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.map_update import PRIOR_MEAN, fuse_ray
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

_NOTHING = int(Return.NOTHING)


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
    """Return cells that cut each axis into as equal parts as whole voxels allow.

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


def no_cells(size: tuple[int, int, int]) -> Cells:
    """Return no cells at all: nothing is pooled."""
    none = np.zeros(0, np.int64)
    return Cells(size, none, none, none, np.zeros(0))


def fresh_sums(cells: Cells) -> np.ndarray:
    """Return (2, C) float64 sums of a belief that nothing has measured: normalised entropy, coverage."""
    return np.stack([cells.voxels, PRIOR_MEAN * cells.voxels])


@inlined_kernel
def normalised_entropy(prior_precision, end_precision, precision):
    """Return 1 at the prior, 0 at the voxel entropy that ends a mission, clipped in between."""
    span = math.log2(end_precision / prior_precision)
    return min(max(math.log2(end_precision / precision) / span, 0.0), 1.0)


class Pool(NamedTuple):
    """The pooled belief of one robot."""

    cells: Cells
    sums: np.ndarray
    """(2, C) float64 sums over the cells: normalised entropy, coverage; changed in place."""
    prior_precision: float
    end_precision: float
    """Between the two entropy is normalised."""


@lean_kernel
def pool_belief(pool, mean, precision):
    """Fill the sums of a Pool from a whole belief, mean and precision (V,) float32."""
    cells, sums = pool.cells, pool.sums
    for cell in range(sums.shape[1]):
        sums[0, cell] = sums[1, cell] = 0.0
    voxel = 0
    for i in range(cells.size[0]):
        for j in range(cells.size[1]):
            for k in range(cells.size[2]):
                cell = cells.x[i] + cells.y[j] + cells.z[k]
                sums[0, cell] += normalised_entropy(
                    pool.prior_precision, pool.end_precision, np.float64(precision[voxel])
                )
                sums[1, cell] += np.float64(mean[voxel])
                voxel += 1


@lean_kernel
def fuse_pooled_scan(scan, count, mean, precision, pool):
    """Fuse a scan as `fuse_scan` does, and keep the sums of the cells that its rays cross up to date.

    Args:
        scan: Scan with crossings filled in.
        count: How many rays of `scan.order`.
        pool: Pool of the same belief.

    Returns:
        Bits taken from the map's entropy in all.
    """
    total = 0.0
    for i in range(count):
        index = scan.order[i]
        ray = scan.rays[index]
        scan.utility[index] = 0.0
        if ray.returned != _NOTHING:
            crossed, coverage = scan.crossed[index], scan.coverage[index]
            _pool_ray(pool, mean, precision, crossed, ray.voxels, -1.0)
            bits = fuse_ray(mean, precision, crossed, coverage, ray.free, ray.voxels, ray.precision)
            _pool_ray(pool, mean, precision, crossed, ray.voxels, 1.0)
            scan.utility[index] = bits
            total += bits
    return total


@lean_kernel
def _pool_ray(pool, mean, precision, crossed, n, sign):
    """Add (sign 1) or take away (-1) what the `n` voxels of a ray contribute to their cells."""
    for i in range(n):
        _pool_voxel(pool, mean, precision, np.int64(crossed[i]), sign)


@lean_kernel
def pool_row(pool, mean, precision, first, last, sign):
    """Add (sign 1) or take away (-1) what the voxels `first` … `last` - 1 contribute to their cells."""
    for voxel in range(first, last):
        _pool_voxel(pool, mean, precision, voxel, sign)


@inlined_kernel
def _pool_voxel(pool, mean, precision, voxel, sign):
    """Add (sign 1) or take away (-1) what a voxel contributes to its cell."""
    cells, sums = pool.cells, pool.sums
    size_y, size_z = cells.size[1], cells.size[2]
    column = voxel // size_z
    cell = cells.x[column // size_y] + cells.y[column % size_y] + cells.z[voxel - column * size_z]
    known = np.float64(precision[voxel])
    sums[0, cell] += sign * normalised_entropy(pool.prior_precision, pool.end_precision, known)
    sums[1, cell] += sign * np.float64(mean[voxel])
