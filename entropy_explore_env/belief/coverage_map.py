"""A belief of voxel coverage: one Gaussian per voxel, as mean and precision 1/σ² (Rocha04, sect. 2-3).

Coverage is the covered share of a voxel, in [0, 1]; information is in bits.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.raycast import TICKS
from entropy_explore_env.compilation.kernels import inlined_kernel
from entropy_explore_env.settings import BITS_OF_UNIT_GAUSSIAN

PRIOR_MEAN = 0.5
"""Expected coverage of a voxel that nobody has measured: no preference."""

_FOLD_BELOW = 1e-250
"""A product of shares is folded into bits, by its log, before it could leave a float64.

Settings keep a share above 1e-16, so that a product that is not yet below stays above 1e-266.
"""

_EDGE = 0.5 + 0.8660254037844387
"""A voxel entered earlier than this before the hit is free by eq. 4: half an edge, half a diagonal."""


def map_entropy_bits(precision: np.ndarray) -> np.ndarray:
    """Entropy of whole maps, H = Σ log2 √(2πe) + log2 σ (Rocha04, eqs. 15 and 25).

    Args:
        precision: (..., X, Y, Z) float32, 1/σ².

    Returns:
        (...) float64, bits.
    """
    logs = np.log2(precision, dtype=np.float64).sum(axis=(-3, -2, -1))
    return BITS_OF_UNIT_GAUSSIAN * math.prod(precision.shape[-3:]) - 0.5 * logs


@inlined_kernel
def measurement_precision(range_m, sigma_min, sigma_slope_per_m):
    """Precision of the coverage that one ray measures, 1/σ(d)² with σ(d) = σ_min + ζ·d (eq. 5)."""
    sigma = sigma_min + sigma_slope_per_m * range_m
    return 1.0 / (sigma * sigma)


@inlined_kernel
def measured_coverage(start, length, size, crossed, entered, n, coverage):
    """Coverage that a hit at `length` says of the voxels on its ray (Rocha04, eq. 4).

        μ(dˡ, d) = clip(½ + (dˡ - d)/vsz, 0, 1)

    with dˡ the distance from the sensor to the voxel's centre. Voxels well before the hit measure
    0; only those near it are worked out.

    Args:
        start: (x, y, z), the sensor in grid units.
        length: Measured distance in voxel edges.
        size: (X, Y, Z) voxels.
        crossed: (L,) int32, voxels of the ray; `n` of them, in order.
        entered: (L,) int64, ticks at which each was entered.
        n: Crossed voxels.
        coverage: (L,) float32, filled from the returned index on.

    Returns:
        Index of the first voxel whose measured coverage may be above 0.
    """
    size_y, size_z = size[1], size[2]
    per_y, per_z = 1.0 / size_y, 1.0 / size_z
    first, near = n, int((length - _EDGE) * TICKS)
    while first > 0 and (first == n or entered[first] > near):
        first -= 1
        # (v + ½)/Z is at least ½/Z away from a whole number: its floor is exact, and no division.
        column = int((crossed[first] + 0.5) * per_z)
        row = int((column + 0.5) * per_y)
        x = row + 0.5 - start[0]
        y = column - row * size_y + 0.5 - start[1]
        z = crossed[first] - column * size_z + 0.5 - start[2]
        beyond = 0.5 + math.sqrt(x * x + y * y + z * z) - length
        coverage[first] = min(max(beyond, 0.0), 1.0)
    return first


@inlined_kernel
def fuse_ray(mean, precision, crossed, coverage, free, n, measured):
    """Fuse one range measurement into the voxels that its ray crosses.

    The product of two Gaussians (Rocha04, eqs. 17-18) adds precisions and weighs means by them;
    the measurement's utility (eq. 27) falls out as

        I = ½ log2 Π p′/p    over the crossed voxels.

    Args:
        mean: (V,) float32, expected coverage in [0, 1]; changed in place.
        precision: (V,) float32, 1/σ², > 0; changed in place.
        crossed: (L,) int32, the crossed voxels, each once; `n` of them.
        coverage: (L,) float32, measured coverage, from index `free` on; before it is 0.
        free: Number of leading voxels that measure 0.
        n: Number of crossed voxels.
        measured: Precision of the measurement, 1/σ(d)².

    Returns:
        Utility in bits, ≥ 0.
    """
    gain, bits, shrink = np.float32(measured), 0.0, 1.0
    for i in range(free):
        voxel = np.uint32(crossed[i])
        before = precision[voxel]
        after = before + gain
        share = before / after
        precision[voxel] = after
        mean[voxel] = mean[voxel] * share
        shrink *= share
        if shrink < _FOLD_BELOW:
            bits -= math.log2(shrink)
            shrink = 1.0
    for i in range(free, n):
        voxel = np.uint32(crossed[i])
        before = precision[voxel]
        after = before + gain
        share = before / after
        precision[voxel] = after
        mean[voxel] = coverage[i] + (mean[voxel] - coverage[i]) * share
        shrink *= share
        if shrink < _FOLD_BELOW:
            bits -= math.log2(shrink)
            shrink = 1.0
    return 0.5 * (bits - math.log2(shrink))


@inlined_kernel
def expected_utility(precision, crossed, n, measured):
    """Utility in bits that a ray over these voxels would bring; nothing is changed (eq. 27).

    Args:
        precision: (V,) float32, 1/σ².
        crossed: (L,) int32, the crossed voxels; `n` of them.
        n: Number of crossed voxels.
        measured: Precision of the measurement, 1/σ(d)².
    """
    bits, growth, gain = 0.0, 1.0, np.float32(measured)
    for i in range(n):
        growth *= np.float32(1.0) + gain / precision[np.uint32(crossed[i])]
        if growth > 1.0 / _FOLD_BELOW:
            bits += math.log2(growth)
            growth = 1.0
    return 0.5 * (bits + math.log2(growth))
