"""Fields that can be read off a belief: entropy gradients and occupancy."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel

_SQRT_HALF = math.sqrt(0.5)


class Belief(NamedTuple):
    """What one robot believes, for kernels."""

    mean: np.ndarray
    """(V,) float32 expected coverage."""
    precision: np.ndarray
    """(V,) float32 1/σ² of it."""
    size: tuple[int, int, int]
    """(X, Y, Z) voxels."""


@inlined_kernel
def entropy_gradient(precision, i, j, k, voxel_size_m):
    """Return the backward difference of the voxel entropy (Rocha04, eq. 30).

        ∇h(l) ≈ 1/vsz · [h(l) - h(l_x-), h(l) - h(l_y-), h(l) - h(l_z-)]

    Along an axis on which voxel l is the first there is no voxel before it: that component is 0.

    Args:
        precision: (X, Y, Z) float32, 1/σ².
        i: Index of voxel l along x.
        j: Along y.
        k: Along z.

    Returns:
        Three components in bits per metre.
    """
    here = math.log2(precision[i, j, k])
    scale = 0.5 / voxel_size_m
    along_x = scale * (math.log2(precision[i - 1, j, k]) - here) if i > 0 else 0.0
    along_y = scale * (math.log2(precision[i, j - 1, k]) - here) if j > 0 else 0.0
    along_z = scale * (math.log2(precision[i, j, k - 1]) - here) if k > 0 else 0.0
    return along_x, along_y, along_z


@inlined_kernel
def remaining_bits(precision, known_precision):
    """Return a voxel's entropy above that of a known one, H(C_l) ≥ 0 (RochaMI, eq. 1; see `visibility`)."""
    return 0.5 * math.log2(max(known_precision / precision, 1.0))


@inlined_kernel
def remaining_entropy_gradient(precision, i, j, k, known_precision):
    """Return the `entropy_gradient` of `remaining_bits`, in bits per voxel edge: 0 between known voxels."""
    here = remaining_bits(precision[i, j, k], known_precision)
    along_x = here - remaining_bits(precision[i - 1, j, k], known_precision) if i > 0 else 0.0
    along_y = here - remaining_bits(precision[i, j - 1, k], known_precision) if j > 0 else 0.0
    along_z = here - remaining_bits(precision[i, j, k - 1], known_precision) if k > 0 else 0.0
    return along_x, along_y, along_z


@inlined_kernel
def occupancy_probability(mean, precision):
    """Return P(c > ½) of a coverage c ~ N(μ, 1/√precision) cut to [0, 1] (Rocha04, eq. 6, for its γ)."""
    scale = math.sqrt(precision) * _SQRT_HALF
    below = math.erf((0.5 - mean) * scale) - math.erf(-mean * scale)
    above = math.erf((1.0 - mean) * scale) - math.erf((0.5 - mean) * scale)
    return above / (above + below) if above + below > 0.0 else 0.5
