"""Viewpoints along the entropy gradient: the voxels near a robot at which the entropy of its map changes.

Places and radii are in grid units.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.fields import entropy_gradient, remaining_entropy_gradient
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type

CANDIDATE = record_type(
    [
        ("place", "f8", (3,)),  # the voxel's centre, grid units; planar robots: at their sensor's height
        ("slope", "f8", (3,)),  # ∇H, bits per voxel edge
        ("yaw", "f8"),
        ("pitch", "f8"),
        ("steepness", "f8"),  # ‖∇H‖
        ("distance", "f8"),  # from the robot, grid units
    ],
)
"""A voxel, and the gaze along the gradient there."""
_TOLERANCE = 1e-6
"""Relative rounding of the radius."""


def gradient_candidates(
    precision: np.ndarray, known_precision: float, position: np.ndarray, radius: float, layer: int | None
) -> np.ndarray:
    """Return the voxels within a radius of a place that have a gradient: N_Γ(x, r) of RochaMI.

    The gradient is the backward difference of Rocha04's eq. 30.

    Args:
        precision: (X, Y, Z) float32, 1/σ².
        known_precision: That of a voxel whose entropy is 0, and never less; inf = entropy has no least value.
        position: (3,) of the robot.
        radius: Of the candidates' centres, finite.
        layer: The only one with candidates, on which gradients are projected; None = the robot flies.

    Returns:
        (K,) CANDIDATE, in the order of their voxels.
    """
    across = [min(2 * math.floor(radius) + 3, size) for size in precision.shape]
    most = across[0] * across[1] * (across[2] if layer is None else 1)
    candidates = np.empty(most, CANDIDATE)
    flat = -1 if layer is None else layer
    return candidates[: _fill_candidates(precision, known_precision, position, radius, flat, candidates)]


@lean_kernel
def _fill_candidates(precision, known_precision, position, radius, layer, candidates):
    """Fill in the candidates, and return how many there are."""
    count, reach, size = 0, radius * (1.0 + _TOLERANCE), precision.shape
    low_x, high_x = _span(position[0], reach, size[0])
    low_y, high_y = _span(position[1], reach, size[1])
    low_z, high_z = _span(position[2], reach, size[2]) if layer < 0 else (layer, layer + 1)
    for i in range(low_x, high_x):
        for j in range(low_y, high_y):
            for k in range(low_z, high_z):
                z = position[2] if layer >= 0 else k + 0.5
                dx, dy, dz = i + 0.5 - position[0], j + 0.5 - position[1], z - position[2]
                squared = dx * dx + dy * dy + dz * dz
                if squared > reach * reach:
                    continue
                if math.isinf(known_precision):
                    x, y, up = entropy_gradient(precision, i, j, k, 1.0)
                else:
                    x, y, up = remaining_entropy_gradient(precision, i, j, k, known_precision)
                if layer >= 0:
                    up = 0.0
                steepness = math.sqrt(x * x + y * y + up * up)
                if steepness <= 0.0:
                    continue
                candidate = candidates[count]
                candidate.place[0], candidate.place[1], candidate.place[2] = i + 0.5, j + 0.5, z
                candidate.slope[0], candidate.slope[1], candidate.slope[2] = x, y, up
                candidate.yaw = math.atan2(y, x)
                candidate.pitch = -math.asin(min(max(up / steepness, -1.0), 1.0))
                candidate.steepness, candidate.distance = steepness, math.sqrt(squared)
                count += 1
    return count


@inlined_kernel
def _span(position, reach, size):
    """Return the first and one past the last index along an axis whose voxel may be within reach."""
    return max(math.floor(position - reach), 0), min(math.floor(position + reach) + 1, size)


@inlined_kernel
def dot(a, b):
    """Return the scalar product of two vectors (x, y, z)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined_kernel
def projection_on(vector, ahead, left):
    """Return the projection (x, y, z) of a vector on the plane of two perpendicular unit vectors."""
    along, across = dot(vector, ahead), dot(vector, left)
    x, y = along * ahead[0] + across * left[0], along * ahead[1] + across * left[1]
    return x, y, along * ahead[2] + across * left[2]
