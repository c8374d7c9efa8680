"""Beliefs projected along a line of sight, from above and from the side: shares of entropy, and coverage.

One pass over the voxels; no temporary array is as large as the world.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel

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
    x, y, z = share.shape
    if z == 1:
        plan = share[:, :, 0]
        return (Projection(plan, np.where(plan < KNOWN_BELOW, coverage[:, :, 0], np.float32(-1.0))),)
    above, side = (Projection(np.zeros(shape), np.zeros(shape)) for shape in ((x, y), (x, z)))
    known = np.zeros((x, y), np.int64), np.zeros((x, z), np.int64)
    _project(share, coverage, above.entropy, above.coverage, known[0], side.entropy, side.coverage, known[1])
    for view, count, depth in zip((above, side), known, (z, y), strict=True):
        view.entropy[:] /= depth
        np.cbrt(view.coverage / np.maximum(count, 1), out=view.coverage)
        view.coverage[count == 0] = -1.0
    return above, side


@lean_kernel
def _project(share, coverage, entropy_above, cover_above, known_above, entropy_side, cover_side, known_side):
    """Sum shares of entropy, and over known voxels the cubes of coverage, along z and along y."""
    for i in range(share.shape[0]):
        for j in range(share.shape[1]):
            for k in range(share.shape[2]):
                left = share[i, j, k]
                entropy_above[i, j] += left
                entropy_side[i, k] += left
                if left < KNOWN_BELOW:
                    cube = coverage[i, j, k] ** 3
                    cover_above[i, j] += cube
                    cover_side[i, k] += cube
                    known_above[i, j] += 1
                    known_side[i, k] += 1


def shares_left(precision: np.ndarray, prior: float, known: float) -> np.ndarray:
    """Return each voxel's share of entropy that is left, float32: 1 at precision `prior`, 0 from `known`.

    Args:
        precision: float32 of any shape, 1/σ² of each voxel; not changed.
        prior: Precision of a voxel that was never measured.
        known: Precision of a voxel that counts as mapped.
    """
    shares = np.empty(precision.shape, np.float32)
    _fill_shares(precision.reshape(-1), float(known), 1.0 / float(np.log2(prior / known)), shares.reshape(-1))
    return shares


@lean_kernel
def _fill_shares(precision, known, scale, shares):
    """Fill in shares of entropy, which is linear in log σ, by the logarithm of the precision."""
    for voxel in range(len(precision)):
        left = np.log2(precision[voxel] / known) * scale
        shares[voxel] = min(max(left, 0.0), 1.0)
