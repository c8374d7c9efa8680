"""Viewpoints along the entropy gradient: the voxels near a robot at which the entropy of its map changes."""

from __future__ import annotations

import math

from entropy_explore_env.belief.fields import remaining_entropy_gradient
from entropy_explore_env.compilation.kernels import lean_kernel, record_type

CANDIDATE = record_type(
    [
        ("place", "f8", (3,)),  # the voxel's centre, grid units; planar robots: at their sensor's height
        ("yaw", "f8"),
        ("pitch", "f8"),
        ("steepness", "f8"),  # ‖∇H‖, bits per voxel edge
        ("distance", "f8"),  # from the robot, grid units
    ],
)
"""A voxel, and the gaze along the gradient there."""
_TOLERANCE = 1e-6


@lean_kernel
def find_gradient_candidates(precision, known_precision, position, radius, layer, candidates):
    """Find the voxels within a radius that have a gradient: N_Γ(x, r) of RochaMI.

    The gradient is the backward difference of Rocha04's eq. 30, of the entropy that is never negative; for
    planar robots of its projection on their layer.

    Args:
        precision: (X, Y, Z) float32 1/σ².
        known_precision: Of a voxel that counts as known.
        position: (3,) of the robot, grid units.
        radius: r̂ in grid units.
        layer: The layer of a planar robot; -1 = it flies.
        candidates: (K,) CANDIDATE, filled in.

    Returns:
        How many there are.
    """
    count, reach = 0, radius * (1.0 + _TOLERANCE)
    size = precision.shape
    first_k = max(math.floor(position[2] - reach), 0) if layer < 0 else layer
    last_k = min(math.floor(position[2] + reach) + 1, size[2]) if layer < 0 else layer + 1
    first_j = max(math.floor(position[1] - reach), 0)
    last_j = min(math.floor(position[1] + reach) + 1, size[1])
    for i in range(
        max(math.floor(position[0] - reach), 0), min(math.floor(position[0] + reach) + 1, size[0])
    ):
        for j in range(first_j, last_j):
            for k in range(first_k, last_k):
                z = position[2] if layer >= 0 else k + 0.5
                dx, dy, dz = i + 0.5 - position[0], j + 0.5 - position[1], z - position[2]
                squared = dx * dx + dy * dy + dz * dz
                if squared > reach * reach:
                    continue
                x, y, up = remaining_entropy_gradient(precision, i, j, k, known_precision)
                if layer >= 0:
                    up = 0.0
                steepness = math.sqrt(x * x + y * y + up * up)
                if steepness <= 0.0:
                    continue
                candidate = candidates[count]
                candidate.place[0], candidate.place[1], candidate.place[2] = i + 0.5, j + 0.5, z
                candidate.yaw = math.atan2(y, x)
                candidate.pitch = -math.asin(min(max(up / steepness, -1.0), 1.0))
                candidate.steepness, candidate.distance = steepness, math.sqrt(squared)
                count += 1
    return count
