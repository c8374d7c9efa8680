"""Cones of view, and the entropy that they cover, by a robot's own belief (RochaMI, eqs. 2, 5 and 7-10).

Positions in grid units, gazes as in robots/range_sensor. A cone is the ball of radius r cut by the cone of
half-angle α about the gaze (RochaMI, eq. 2). What it covers is a sum over the voxels whose centres lie in it
(eqs. 5 and 7-10), of an entropy that is never negative, as the discrete one of RochaMI's eq. 1: the bits by
which a voxel's differential entropy exceeds that of a voxel that counts as known (the mission's σ_end),

    H(C_l) = max(h(σ_l) - h(σ_known), 0) = max(½ log2(p_known / p_l), 0).

As in the paper, obstacles hide nothing.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type

CONE = record_type(
    [
        ("apex", "f8", (3,)),  # grid units
        ("gaze", "f8", (3,)),  # unit vector, map frame
        ("radius", "f8"),  # r, voxel edges
        ("cosine", "f8"),  # of α
    ],
)
"""What a robot sees, or will see, from a viewpoint."""


_FOLD_ABOVE = 1e250
_FARTHEST = 2.0**21
"""Longer than any workspace, in voxel edges: radii may be infinite."""
_SLACK = 1e-9
"""Tolerance of a cone's angle, as a share of the distance."""


def cone_of(viewpoint: np.ndarray, radius: float, half_angle_rad: float) -> np.ndarray:
    """Return the () CONE of a viewpoint (5,): x, y, z in grid units, yaw, pitch; radius in voxel edges."""
    cone = np.zeros((), CONE)
    yaw, pitch = float(viewpoint[3]), float(viewpoint[4])
    cone["apex"] = viewpoint[:3]
    cone["gaze"] = math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch)
    cone["radius"], cone["cosine"] = radius, math.cos(half_angle_rad)
    return cone


@inlined_kernel
def in_cone(cone, dx, dy, dz):
    """Return whether a point, relative to the apex, lies in a CONE or on its face (RochaMI, eq. 2)."""
    squared = dx * dx + dy * dy + dz * dz
    along = dx * cone.gaze[0] + dy * cone.gaze[1] + dz * cone.gaze[2]
    return squared <= cone.radius * cone.radius and along >= math.sqrt(squared) * cone.cosine - _SLACK


@inlined_kernel
def _span(cone, axis, size):
    """Return the first and one past the last index along an axis whose centres may lie in a cone.

    No direction in the cone comes nearer to the axis than its angle from the gaze less α.
    """
    half = math.acos(min(max(cone.cosine, -1.0), 1.0))
    angle = math.acos(min(max(cone.gaze[axis], -1.0), 1.0))
    radius = min(cone.radius, _FARTHEST)
    ahead = radius * max(math.cos(max(angle - half, 0.0)), 0.0)
    behind = radius * max(math.cos(max(math.pi - angle - half, 0.0)), 0.0)
    first, last = math.floor(cone.apex[axis] - behind - 0.5), math.floor(cone.apex[axis] + ahead + 0.5)
    return max(first, 0), min(last + 1, size)


@lean_kernel
def mark_cones(cones, size, marks):
    """Mark the voxels that are visible in any of (M,) CONE (RochaMI, eqs. 5 and 8).

    Args:
        marks: (V,) uint8; those of visible voxels become 1.
    """
    for cone in cones:
        first_x, last_x = _span(cone, 0, size[0])
        first_y, last_y = _span(cone, 1, size[1])
        first_z, last_z = _span(cone, 2, size[2])
        for i in range(first_x, last_x):
            for j in range(first_y, last_y):
                for k in range(first_z, last_z):
                    if in_cone(cone, i + 0.5 - cone.apex[0], j + 0.5 - cone.apex[1], k + 0.5 - cone.apex[2]):
                        marks[np.uint32(flat_index(size, i, j, k))] = 1


@lean_kernel
def visible_bits(cone, size, precision, known_precision, marks):
    """Return the entropy that a cone covers, and its part in marked voxels (RochaMI, eqs. 7 and 10).

    Args:
        known_precision: 1/σ² of a voxel that counts as known.
        marks: (V,) uint8, 1 for the voxels that the teammates cover.

    Returns:
        (H, I): H(Cⁱ) and I(Cⁱ; Tⁱ) in bits, H ≥ I ≥ 0.
    """
    own, shared, own_growth, shared_growth = 0.0, 0.0, np.float64(1.0), np.float64(1.0)
    first_x, last_x = _span(cone, 0, size[0])
    first_y, last_y = _span(cone, 1, size[1])
    first_z, last_z = _span(cone, 2, size[2])
    for i in range(first_x, last_x):
        for j in range(first_y, last_y):
            for k in range(first_z, last_z):
                if in_cone(cone, i + 0.5 - cone.apex[0], j + 0.5 - cone.apex[1], k + 0.5 - cone.apex[2]):
                    voxel = np.uint32(flat_index(size, i, j, k))
                    ratio = max(known_precision / precision[voxel], 1.0)
                    if marks[voxel] > 0:
                        shared_growth *= ratio
                    else:
                        own_growth *= ratio
                    if own_growth > _FOLD_ABOVE or shared_growth > _FOLD_ABOVE:
                        own, shared = own + math.log2(own_growth), shared + math.log2(shared_growth)
                        own_growth, shared_growth = np.float64(1.0), np.float64(1.0)
    own, shared = own + math.log2(own_growth), shared + math.log2(shared_growth)
    return 0.5 * (own + shared), 0.5 * shared
