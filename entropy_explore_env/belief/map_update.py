"""How a range measurement changes a belief, and what it brings (Rocha04, sect. 2-3).

A belief holds one Gaussian of coverage per voxel, as mean and precision 1/σ². Coverage is the covered share
of a voxel, in [0, 1]; information is in bits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type

_NOTHING = int(Return.NOTHING)

PRIOR_MEAN = 0.5
"""Expected coverage of a voxel that was never measured: no preference."""

_FOLD_BELOW = 1e-250
"""A product of precision ratios is folded into bits, by its logarithm, before it could leave a float64.

Settings keep a ratio above 1e-16, so that a product that is not yet below stays above 1e-266.
"""
ROW_FOLD_BELOW = 1e-100
"""The same for rows, of which two are multiplied."""


RAY = record_type(
    [
        ("direction", "f8", (3,)),  # unit vector, map frame
        ("cos_pitch", "f8"),  # of that direction
        ("length", "f8"),  # measured distance in grid units
        ("range_m", "f8"),  # the same in metres; 0 if nothing was measured
        ("returned", "i8"),  # a Return
        ("precision", "f8"),  # of the measured coverage, 1/σ(d)²
        ("free", "i8"),  # leading voxels that measure coverage 0
        ("voxels", "i8"),  # voxels on the ray
    ],
)
"""One ray of a scan, as it is processed."""


class Scan(NamedTuple):
    """Working space of one scan, or of one batch of received measurements; R rays, L voxels per ray."""

    rays: np.ndarray
    """(R,) RAY."""
    utility: np.ndarray
    """(R,) float64 bits that the measurement brought to the map that fused it last (Rocha04, eq. 27)."""
    crossed: np.ndarray
    """(R, L) int32 voxels on each ray."""
    entered: np.ndarray
    """(L,) int64 ticks at which the latest ray entered its voxels."""
    coverage: np.ndarray
    """(R, L) float32 measured coverage, from index `free` on."""
    order: np.ndarray
    """(R,) int64 rays in the order in which they are fused or sent."""


@inlined_kernel
def fuse_ray(mean, precision, crossed, coverage, free, n, measured):
    """Fuse one range measurement into the voxels that its ray crosses.

    The product of two Gaussians (Rocha04, eqs. 17-18) adds precisions and weighs means by them;
    the measurement's utility (eq. 27) falls out as

        I = ½ log2 Π p′/p    over the crossed voxels.

    Args:
        mean: (V,) float32, expected coverage in [0, 1]; changed in place.
        crossed: (L,) int32, the crossed voxels, each once; `n` of them.
        coverage: (L,) float32, measured coverage, from index `free` on; before it is 0.
        free: Number of leading voxels that measure 0.
        measured: Precision of the measurement, 1/σ(d)².

    Returns:
        Utility in bits, ≥ 0.
    """
    gain, bits, shrink = np.float32(measured), 0.0, np.float64(1.0)
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
            shrink = np.float64(1.0)
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
            shrink = np.float64(1.0)
    return 0.5 * (bits - math.log2(shrink))


@lean_kernel
def gather_ray(mean, precision, crossed, coverage, free, n, measured):
    """Fuse one range measurement into a map that may know nothing: like `fuse_ray`, from precision 0 on.

    A measurement whose precision is too small for a float32 changes nothing.
    """
    gain = np.float32(measured)
    if gain <= np.float32(0.0):
        return
    for i in range(n):
        voxel, said = np.uint32(crossed[i]), coverage[i] if i >= free else np.float32(0.0)
        before = precision[voxel]
        precision[voxel] = before + gain
        mean[voxel] = said + (mean[voxel] - said) * (before / (before + gain))


@inlined_kernel
def fuse_row(mean, precision, first, last, coverage, measured):
    """Fuse one Gaussian of coverage into each of the voxels `first` … `last` - 1 (Rocha04, eqs. 17-18).

    Args:
        first: Number of the first voxel.
        last: One past the last.
        coverage: float32, the mean that is fused.
        measured: float32, its 1/σ².

    Returns:
        (bits, shrink): the utility in bits (eq. 27) is bits - ½ log2 shrink, so that a logarithm is needed
        but once for some rows: their bits add up, and their shrinks multiply.
    """
    bits, shrink = 0.0, np.float64(1.0)
    for voxel in range(first, last):
        before = precision[voxel]
        after = before + measured
        share = before / after
        precision[voxel] = after
        mean[voxel] = coverage + (mean[voxel] - coverage) * share
        shrink *= share
        if shrink < ROW_FOLD_BELOW:
            bits -= 0.5 * math.log2(shrink)
            shrink = np.float64(1.0)
    return bits, shrink


@inlined_kernel
def expected_utility(precision, crossed, n, measured):
    """Return the utility in bits that a ray over these voxels would bring; nothing is changed (eq. 27).

    Args:
        crossed: (L,) int32, the crossed voxels; `n` of them.
        measured: Precision of the measurement, 1/σ(d)².
    """
    bits, growth, gain = 0.0, np.float64(1.0), np.float32(measured)
    for i in range(n):
        growth *= np.float32(1.0) + gain / precision[np.uint32(crossed[i])]
        if growth > 1.0 / _FOLD_BELOW:
            bits += math.log2(growth)
            growth = np.float64(1.0)
    return 0.5 * (bits + math.log2(growth))


@lean_kernel
def fuse_scan(scan, count, mean, precision):
    """Fuse measurements into a belief, ray by ray (Rocha04, eqs. 17-18, 27 and 29).

    Args:
        scan: Scan with crossings filled in; its `utility` is filled with the bits of each ray.
        count: How many rays of `scan.order`, in this order; those that measured nothing bring 0.
        mean: (V,) float32 expected coverage, changed in place.

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
            bits = fuse_ray(mean, precision, crossed, coverage, ray.free, ray.voxels, ray.precision)
            scan.utility[index] = bits
            total += bits
    return total
