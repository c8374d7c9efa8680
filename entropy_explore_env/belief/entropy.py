"""Entropy of a robot's map in bits (Rocha04, eqs. 15 and 25)."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.settings import BITS_OF_UNIT_GAUSSIAN


def map_entropy_bits(precision: np.ndarray) -> np.ndarray:
    """Entropy of whole maps, H = Σ log2 √(2πe) + log2 σ (Rocha04, eqs. 15 and 25).

    Args:
        precision: (..., X, Y, Z) float32, 1/σ².

    Returns:
        (...) float64, bits.
    """
    logs = np.log2(precision, dtype=np.float64).sum(axis=(-3, -2, -1))
    return BITS_OF_UNIT_GAUSSIAN * math.prod(precision.shape[-3:]) - 0.5 * logs
