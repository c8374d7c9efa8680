"""Viewpoints along the entropy gradient: the voxels near a robot at which the entropy of its map changes.

`mean` and `precision` are (X, Y, Z) float32, expected coverage and 1/σ²; `position` is (3,), the robot in
grid units, in which radius and reach are, too.
"""

from __future__ import annotations

import math

from entropy_explore_env.belief.fields import entropy_gradient, remaining_entropy_gradient
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type

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
"""Relative rounding of the radius."""


@lean_kernel
def find_gradient_candidates(precision, known_precision, position, radius, layer, candidates):
    """Find the voxels within a radius of a place that have a gradient: N_Γ(x, r) of RochaMI.

    The gradient is the backward difference of Rocha04's eq. 30, of the entropy that is never negative, above
    that of a voxel of `known_precision`; for planar robots of its projection on their layer, -1 = the robot
    flies. (K,) CANDIDATE are filled in, and the number of them is returned.
    """
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


@lean_kernel
def steepest_viewpoint(mean, precision, position, yaw, pitch, reach, projected, viewpoint):
    """Choose among the voxels within reach (Rocha04, eqs. 32-34, or 38-40 if projected).

        free-flying:  argmax ‖∇h(l)‖ (1 - μ_l),                     gaze along ∇h
        projected:    argmax ρ(pos, l) ‖proj ∇h(l)‖ (1 - μ_l),      gaze along proj ∇h

    The robot's motion plane is that of its yaw and pitch. Of equal voxels the first in C order is taken. (5,)
    float64 `viewpoint` is filled with the voxel's centre, yaw and pitch, and True is returned, unless the
    gradient is zero everywhere.
    """
    ahead = (math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch))
    left = (-math.sin(yaw), math.cos(yaw), 0.0)
    best, found = 0.0, False
    low_x, high_x = _span(position[0], reach, mean.shape[0])
    low_y, high_y = _span(position[1], reach, mean.shape[1])
    low_z, high_z = _span(position[2], reach, mean.shape[2])
    for i in range(low_x, high_x):
        for j in range(low_y, high_y):
            for k in range(low_z, high_z):
                step = (i + 0.5 - position[0], j + 0.5 - position[1], k + 0.5 - position[2])
                length = _length(step)
                if length > reach * (1.0 + _TOLERANCE):
                    continue
                slope, reachable = entropy_gradient(precision, i, j, k, 1.0), 1.0
                if projected:
                    slope = _on_plane(slope, ahead, left)
                    if length > 0.0:
                        reachable = _length(_on_plane(step, ahead, left)) / length
                steepness = _length(slope)
                score = reachable * steepness * (1.0 - mean[i, j, k])
                if score > best:
                    best, found = score, True
                    viewpoint[0], viewpoint[1], viewpoint[2] = i + 0.5, j + 0.5, k + 0.5
                    viewpoint[3] = yaw
                    if slope[0] != 0.0 or slope[1] != 0.0:
                        viewpoint[3] = math.atan2(slope[1], slope[0])
                    viewpoint[4] = -math.asin(min(max(slope[2] / steepness, -1.0), 1.0))
    return found


@inlined_kernel
def _span(position, reach, size):
    """Return the first and one past the last index along an axis whose voxel may be within reach."""
    return max(math.floor(position - reach), 0), min(math.floor(position + reach) + 1, size)


@inlined_kernel
def _length(vector):
    """Return the length of a vector (x, y, z)."""
    return math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@inlined_kernel
def _on_plane(vector, ahead, left):
    """Return the projection of (x, y, z) on the robot's motion plane (Rocha04, eq. 37)."""
    along = vector[0] * ahead[0] + vector[1] * ahead[1] + vector[2] * ahead[2]
    across = vector[0] * left[0] + vector[1] * left[1] + vector[2] * left[2]
    return (
        along * ahead[0] + across * left[0],
        along * ahead[1] + across * left[1],
        along * ahead[2] + across * left[2],
    )
