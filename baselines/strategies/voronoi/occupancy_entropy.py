"""Occupancy entropy of a Gaussian belief, and what a way through it costs: the fields of Voronoi coverage.

Bhattacharya 2010 works on occupancy probabilities p; a voxel with coverage c ~ N(μ, σ) cut to [0, 1] is
occupied with p = P(c > ½). Entropies are in nats, from 0 to ln 2.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from baselines.strategies.voronoi.controls import LN2
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

_SQRT_HALF = math.sqrt(0.5)
_SURE = 6.0
"""So many standard deviations from ½ a voxel is sure: its entropy is below 3e-8."""


@inlined_kernel
def occupancy_probability(mean: float, precision: float) -> float:
    """P(c > ½) of a coverage c ~ N(μ, 1/√precision) cut to [0, 1] (Rocha04, eq. 6, for its γ)."""
    scale = math.sqrt(precision) * _SQRT_HALF
    below = math.erf((0.5 - mean) * scale) - math.erf(-mean * scale)
    above = math.erf((1.0 - mean) * scale) - math.erf((0.5 - mean) * scale)
    return above / (above + below) if above + below > 0.0 else 0.5


@lean_kernel
def fill_occupancy_entropy(mean: np.ndarray, precision: np.ndarray, entropy: np.ndarray) -> None:
    """Fill (V,) float32 nats, e = -p ln p - (1 - p) ln(1 - p) (eq. 9 with the sign that it lacks)."""
    for voxel in range(len(mean)):
        mu, known = np.float64(mean[voxel]), np.float64(precision[voxel])
        if mu == 0.5:
            entropy[voxel] = LN2
        elif (mu - 0.5) * (mu - 0.5) * known > _SURE * _SURE:
            entropy[voxel] = 0.0
        else:
            p = occupancy_probability(mu, known)
            q = 1.0 - p
            entropy[voxel] = -p * math.log(p) - q * math.log(q) if 0.0 < p < 1.0 else 0.0


@lean_kernel
def fill_deviation_entropy(
    precision: np.ndarray, prior_precision: float, end_precision: float, entropy: np.ndarray
) -> None:
    """Fill (V,) float32: ln 2 at the prior, 0 from the end's precision on, linear in log σ between them.

    What Rocha04's missions ask for: a voxel is known when its standard deviation is σ_end.
    """
    scale = LN2 / math.log(end_precision / prior_precision)
    for voxel in range(len(precision)):
        left = math.log(end_precision / np.float64(precision[voxel])) * scale
        entropy[voxel] = min(max(left, 0.0), LN2)


def filtered(entropy: np.ndarray) -> np.ndarray:
    """The least entropy of each voxel and those around it (sect. 5.3): 3 × 3, or 3 × 3 × 3."""
    return ndimage.minimum_filter(entropy, size=[3 if n > 1 else 1 for n in entropy.shape], mode="nearest")


@lean_kernel
def close_voxels(
    mean: np.ndarray,
    touched: np.ndarray,
    margin: tuple[int, int, int],
    layer: int,
    start: tuple[int, int, int],
    rates: np.ndarray,
) -> None:
    """Make voxels impassable in which a body does not fit; what it touches from its start may be left.

    Args:
        mean: (X, Y, Z) float32, expected coverage; above ½ nobody enters.
        touched: (B, 3) int64, offsets of the voxels that the body touches; empty = its own only.
        margin: Layers at either end of each axis that are too near to the boundary.
        layer: The only one that can be entered; -1 = all.
        start: The robot's voxel.
        rates: (X, Y, Z) float32, set to inf there.
    """
    size_x, size_y, size_z = mean.shape
    for x in range(size_x):
        for y in range(size_y):
            for z in range(size_z):
                outside = x < margin[0] or y < margin[1] or z < margin[2]
                outside = outside or x >= size_x - margin[0] or y >= size_y - margin[1]
                if outside or z >= size_z - margin[2] or (layer >= 0 and z != layer):
                    rates[x, y, z] = math.inf
                if mean[x, y, z] > STOP_AT_COVERED:
                    rates[x, y, z] = math.inf
                    for offset in touched:
                        i, j, k = x - offset[0], y - offset[1], z - offset[2]
                        if 0 <= i < size_x and 0 <= j < size_y and 0 <= k < size_z:
                            rates[i, j, k] = math.inf
    if math.isinf(rates[start[0], start[1], start[2]]):
        for offset in touched:
            i, j, k = start[0] + offset[0], start[1] + offset[1], start[2] + offset[2]
            if 0 <= i < size_x and 0 <= j < size_y and 0 <= k < size_z and (layer < 0 or k == layer):
                if mean[i, j, k] <= STOP_AT_COVERED:
                    rates[i, j, k] = LN2
        rates[start[0], start[1], start[2]] = LN2
