"""New information in a view, and the distance of a pose (Sujan, eqs. 6-8 and 22)."""

from __future__ import annotations

import math

import numpy as np

from baselines.strategies.next_best_view.expected_view import LEVELS

_MIDDLES = (np.arange(LEVELS) + 0.5) / LEVELS
UNCERTAINTY = -(_MIDDLES * np.log2(_MIDDLES) + (1.0 - _MIDDLES) * np.log2(1.0 - _MIDDLES))
"""(LEVELS,) -(p log2 p + (1 - p) log2(1 - p)) in the middle of each interval of occupancy."""


def new_information(
    shares: np.ndarray, most: float, weights: np.ndarray | None = UNCERTAINTY, linear: bool = False
) -> float:
    """Return NI in bits of the histograms of a view.

        NI = Σ_known u(p_k)·(-q_k log2 q_k) + Σ_unknown u(p_k)·(-q_k log2 q_k)

    with q_k = n_k/N. With u of `UNCERTAINTY` it is eq. 8; with u = 1 and stretched occupancies eq. 6, whose
    second sum has lost its minus sign in print.

    Args:
        shares: (2, LEVELS) number of known and unknown voxels in each interval.
        most: N, the largest number of voxels in view.
        weights: (LEVELS,) u; None = 1.
        linear: Whether q_k stands in place of -q_k log2 q_k: ours, to compare with.
    """
    q = np.minimum(shares / most, 1.0)
    bits = q if linear else -q * np.log2(np.where(q > 0.0, q, 1.0))
    return float((bits if weights is None else bits * weights).sum())


def pose_distance(pose: np.ndarray, viewpoint: np.ndarray) -> float:
    """Return D of eq. 22 with all α = 1, between poses (5,): x, y, z in metres, yaw and pitch in radians."""
    apart = viewpoint - pose
    apart[3] = (apart[3] + math.pi) % (2.0 * math.pi) - math.pi
    return float(np.linalg.norm(apart))
