"""Beliefs projected along a line of sight, from above and from the side: shares of entropy, and coverage."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

KNOWN_BELOW = 0.9
"""A voxel counts as known when less than this share of its entropy is left."""


class Projection(NamedTuple):
    """A belief (X, Y, Z) projected along one axis to (N, M) cells."""

    entropy: np.ndarray
    """(N, M) floating-point, mean share of entropy."""
    coverage: np.ndarray
    """(N, M) floating-point, cubic mean of the known voxels' coverage; -1 where none is known."""


def projections(share: np.ndarray, coverage: np.ndarray) -> tuple[Projection, ...]:
    """Project a belief along z, to (X, Y), and along y, to (X, Z); a 2-D one along z only.

    The cubic mean, (Σc³/n)^⅓, lies between the mean, in which the top of a box fades, and the greatest, in
    which floor and ceiling hide the halls between them.

    Args:
        share: (X, Y, Z) float32, the share of each voxel's entropy that is left; not changed.
        coverage: (X, Y, Z) float32, expected coverage in [0, 1]; not changed.
    """
    if share.shape[2] == 1:
        plan = share[:, :, 0]
        return (Projection(plan, np.where(plan < KNOWN_BELOW, coverage[:, :, 0], np.float32(-1.0))),)
    known = share < KNOWN_BELOW
    cubes = np.where(known, coverage, np.float32(0.0)) ** 3
    return tuple(_projection(share, known, cubes, axis) for axis in (2, 1))


def _projection(share: np.ndarray, known: np.ndarray, cubes: np.ndarray, axis: int) -> Projection:
    """Project shares of entropy, and the cubes of known voxels' coverage, (X, Y, Z) each, along an axis."""
    count = known.sum(axis)
    coverage = np.cbrt(cubes.sum(axis, dtype=np.float64) / np.maximum(count, 1))
    coverage[count == 0] = -1.0
    return Projection(share.mean(axis, dtype=np.float64), coverage)


def shares_left(precision: np.ndarray, prior: float, known: float) -> np.ndarray:
    """Return each voxel's share of entropy that is left, float32: 1 at precision `prior`, 0 from `known`.

    It is linear in log σ.

    Args:
        precision: float32 of any shape, 1/σ² of each voxel; not changed.
        prior: Precision of a voxel that was never measured.
        known: Precision of a voxel that counts as mapped.
    """
    left = np.log2(precision / np.float64(known)) / np.log2(prior / known)
    return np.clip(left, 0.0, 1.0).astype(np.float32)
