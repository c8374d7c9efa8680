"""What one range measurement says of the voxels on its ray (Rocha04, eqs. 4-5).

Coverage is the covered share of a voxel, in [0, 1].
"""

from __future__ import annotations

import enum
import math

from entropy_explore_env.belief.raycast import TICKS
from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel


class Return(enum.IntEnum):
    """What came back along a ray."""

    NOTHING = 0
    """No measurement: a teammate's body was in the way, the return was too near, or the surface gave none."""
    FREE = 1
    """No return within the sensor's range: all that the ray crossed is free."""
    HIT = 2
    """The distance of an obstacle or of the workspace's boundary."""


_EDGE = 0.5 + 0.8660254037844387
"""A voxel entered earlier than this before the hit is free by eq. 4: half an edge, half a diagonal."""


@inlined_kernel
def measurement_precision(range_m, sigma_min, sigma_slope_per_m, sigma_exponent):
    """Return the precision of the coverage that one ray measures, 1/σ(d)² with σ(d) = σ_min + ζ·dⁿ.

    With n = 1 that is Rocha04's eq. 5; stereo cameras have n = 2 (Sujan, eq. 4: σ = S·T·Lⁿ).
    """
    grown = range_m if sigma_exponent == 1.0 else range_m**sigma_exponent
    sigma = sigma_min + sigma_slope_per_m * grown
    return 1.0 / (sigma * sigma)


@inlined_kernel
def measured_coverage(start, length, size, crossing, n, coverage):
    """Return the coverage that a hit at `length` says of the voxels on its ray (Rocha04, eq. 4).

        μ(dˡ, d) = clip(½ + (dˡ - d)/vsz, 0, 1)

    with dˡ the distance from the sensor to the voxel's centre. Voxels well before the hit measure 0; only
    those near it are computed.

    Args:
        length: Measured distance in voxel edges.
        coverage: (L,) float32, filled from the returned index on.

    Returns:
        Index of the first voxel whose measured coverage may be above 0.
    """
    crossed, entered = crossing.voxels, crossing.entered
    first, near = n, int((length - _EDGE) * TICKS)
    while first > 0 and (first == n or entered[first] > near):
        first -= 1
        i, j, k = grid_index(size, crossed[first])
        x, y, z = i + 0.5 - start[0], j + 0.5 - start[1], k + 0.5 - start[2]
        beyond = 0.5 + math.sqrt(x * x + y * y + z * z) - length
        coverage[first] = min(max(beyond, 0.0), 1.0)
    return first
