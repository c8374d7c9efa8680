"""Entropy of a robot's map: of coverage in bits (Rocha04, eqs. 15 and 25), of occupancy in nats."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.fields import occupancy_probability
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.settings.ending import BITS_OF_UNIT_GAUSSIAN


def map_entropy_bits(precision: np.ndarray) -> np.ndarray:
    """Return the entropy of whole maps, H = Σ log2 √(2πe) + log2 σ (Rocha04, eqs. 15 and 25).

    Args:
        precision: (..., X, Y, Z) float32, 1/σ².

    Returns:
        (...) float64, bits.
    """
    logs = np.log2(precision, dtype=np.float64).sum(axis=(-3, -2, -1))
    return BITS_OF_UNIT_GAUSSIAN * math.prod(precision.shape[-3:]) - 0.5 * logs


LN2 = math.log(2.0)
"""Entropy of an occupancy of probability ½, in nats: that of a voxel that was never measured."""
_CERTAIN = 6.0
"""From this many standard deviations away from ½ on a voxel is certain: its entropy is below 3e-8."""


@lean_kernel
def fill_occupancy_entropy(mean, precision, entropy):
    """Fill (V,) with nats of occupancy, e = -p ln p - (1 - p) ln(1 - p) with p = P(c > ½).

    Bhattacharya 2010, eq. 9, with the sign that it lacks.
    """
    for voxel in range(len(mean)):
        mu, known = np.float64(mean[voxel]), np.float64(precision[voxel])
        if mu == 0.5:
            entropy[voxel] = LN2
        elif (mu - 0.5) * (mu - 0.5) * known > _CERTAIN * _CERTAIN:
            entropy[voxel] = 0.0
        else:
            p = occupancy_probability(mu, known)
            q = 1.0 - p
            entropy[voxel] = -p * math.log(p) - q * math.log(q) if 0.0 < p < 1.0 else 0.0
