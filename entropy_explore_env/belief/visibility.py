"""What a robot would see from a viewpoint, by its own belief: cones of sight, and a scan's expected bits.

Positions in grid units, gazes as in robots/range_sensor. A cone is the ball of radius r cut by the cone of
half-angle α about the gaze (RochaMI, eq. 2).
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.coverage_map import measurement_precision
from entropy_explore_env.belief.raycast import STOP_AT_COVERED, cast_ray
from entropy_explore_env.compilation import inlined_kernel, lean_kernel

CONE = np.dtype(
    [
        ("apex", "f8", (3,)),  # grid units
        ("gaze", "f8", (3,)),  # unit vector, map frame
        ("radius", "f8"),  # r, voxel edges
        ("cosine", "f8"),  # of α
    ],
    align=True,
)
"""What a teammate sees, or will see."""

SIGHT = np.dtype(
    [
        ("max_range_m", "f8"),
        ("sigma_min", "f8"),
        ("sigma_slope_per_m", "f8"),
        ("voxels_behind", "i8"),
        ("known", "f8"),  # a voxel with less precision is unknown
        ("blocking", "f8"),  # probability that an unknown voxel stops a ray
        ("rays", "f8"),  # rays of the sensor that each imagined one stands for
    ],
    align=True,
)
"""How a scan is imagined."""

_FOLD_ABOVE = 1e250


def cone_of(viewpoint: np.ndarray, radius: float, half_angle_rad: float) -> np.ndarray:
    """() CONE from a viewpoint (5,): x, y, z in grid units, yaw, pitch; radius in voxel edges."""
    cone = np.zeros((), CONE)
    yaw, pitch = float(viewpoint[3]), float(viewpoint[4])
    cone["apex"] = viewpoint[:3]
    cone["gaze"] = math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch)
    cone["radius"], cone["cosine"] = radius, math.cos(half_angle_rad)
    return cone


@inlined_kernel
def in_cones(cones, x, y, z):
    """Whether a point in grid units lies in any of (M,) CONE (RochaMI, eq. 2)."""
    for cone in cones:
        dx, dy, dz = x - cone.apex[0], y - cone.apex[1], z - cone.apex[2]
        squared = dx * dx + dy * dy + dz * dz
        if squared <= cone.radius * cone.radius:
            along = dx * cone.gaze[0] + dy * cone.gaze[1] + dz * cone.gaze[2]
            if along >= math.sqrt(squared) * cone.cosine - 1e-9:
                return True
    return False


@lean_kernel
def expected_scan_bits(
    mean, precision, size, voxel_size_m, viewpoint, yaw_offsets, pitch_offsets, sight, cones, scratch
):
    """Bits that a scan from a viewpoint is expected to take from the robot's map.

    Rays go through the belief like those of a scan, until something believed covered. A voxel that nobody
    has measured stops a ray with the probability `blocking`, so what lies behind counts for less. What all
    rays add to a voxel counts once,

        I = Σ ½ log2(1 + Σ_rays w/σ(d)² / p),

    with p the voxel's precision, d the ray's way and w the probability that it gets there (Rocha04, eqs. 5,
    17 and 27). Voxels whose centres lie in one of the cones are somebody else's, and count nothing.

    Args:
        mean: (V,) float32 expected coverage.
        precision: (V,) float32 1/σ².
        size: (X, Y, Z) voxels.
        voxel_size_m: Edge of a voxel.
        viewpoint: (5,) x, y, z in grid units, yaw, pitch.
        yaw_offsets: (columns,) radians from the gaze.
        pitch_offsets: (rows,) radians from the gaze.
        sight: A SIGHT.
        cones: (M,) CONE.
        scratch: (added, touched, crossed, entered): (V,) float32 of zeros, which it is again afterwards;
            (V,) int32; and what `cast_ray` needs.

    Returns:
        Bits ≥ 0.
    """
    added, touched, crossed, entered = scratch
    start, count = (viewpoint[0], viewpoint[1], viewpoint[2]), 0
    reach = sight.max_range_m / voxel_size_m
    for column in range(len(yaw_offsets)):
        turn = viewpoint[3] + yaw_offsets[column]
        along, across = math.cos(turn), math.sin(turn)
        for row in range(len(pitch_offsets)):
            angle = viewpoint[4] + pitch_offsets[row]
            level = math.cos(angle)
            direction = (along * level, across * level, -math.sin(angle))
            length, n, _ = cast_ray(
                mean,
                STOP_AT_COVERED,
                size,
                start,
                direction,
                reach,
                False,
                sight.voxels_behind,
                crossed,
                entered,
            )
            range_m = length * voxel_size_m
            gain = sight.rays * measurement_precision(range_m, sight.sigma_min, sight.sigma_slope_per_m)
            for i in range(n):
                voxel = np.uint32(crossed[i])
                if added[voxel] == 0.0:
                    touched[count] = crossed[i]
                    count += 1
                added[voxel] += np.float32(gain)
                if precision[voxel] < sight.known:
                    gain *= 1.0 - sight.blocking
    return _gathered_bits(precision, size, cones, added, touched, count)


@inlined_kernel
def _gathered_bits(precision, size, cones, added, touched, count):
    """Σ ½ log2(1 + added/p) over the touched voxels outside the cones; what was added is cleared."""
    bits, growth = 0.0, 1.0
    for i in range(count):
        voxel = np.uint32(touched[i])
        share = np.float64(added[voxel]) / np.float64(precision[voxel])
        added[voxel] = 0.0
        if len(cones) > 0:
            column = touched[i] // size[2]
            x, y, z = column // size[1] + 0.5, column % size[1] + 0.5, touched[i] - column * size[2] + 0.5
            if in_cones(cones, x, y, z):
                continue
        growth *= 1.0 + share
        if growth > _FOLD_ABOVE:
            bits += math.log2(growth)
            growth = 1.0
    return 0.5 * (bits + math.log2(growth))
