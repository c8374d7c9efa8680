"""What a robot would see from a viewpoint, by its own belief: cones of sight, and a scan's expected bits.

Positions in grid units, gazes as in robots/range_sensor. A cone is the ball of radius r cut by the cone of
half-angle α about the gaze (RochaMI, eq. 2). What it covers is a sum over the voxels whose centres lie in it
(eqs. 5 and 7-10), of an entropy that is never negative, as the discrete one of RochaMI's eq. 1: the bits by
which a voxel's differential entropy exceeds that of a voxel that counts as known (the mission's σ_end),

    H(C_l) = max(h(σ_l) - h(σ_known), 0) = max(½ log2(p_known / p_l), 0).

Where `sight` is given, (mean, crossed, entered) with the working space of `cast_ray`, voxels behind something
believed covered are not visible; the paper's cone ignores obstacles: `sight` = None.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.measurement_model import measurement_precision
from entropy_explore_env.belief.raycast import OPEN, STOP_AT_COVERED, cast_ray
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

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
        ("min_range_m", "f8"),
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
_SLACK = 1e-9
"""Of the angle of a cone, as a share of the distance: a point on its face is inside."""


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
            if along >= math.sqrt(squared) * cone.cosine - _SLACK:
                return True
    return False


@inlined_kernel
def in_cone(cone, dx, dy, dz):
    """Whether a point, relative to the apex, lies in a CONE: see `in_cones`."""
    squared = dx * dx + dy * dy + dz * dz
    along = dx * cone.gaze[0] + dy * cone.gaze[1] + dz * cone.gaze[2]
    return squared <= cone.radius * cone.radius and along >= math.sqrt(squared) * cone.cosine - _SLACK


@inlined_kernel
def _column_span(cone, dx, dy, layers):
    """First and one past the last layer of a column of voxels in which centres may lie in a cone.

    The column stands at (dx, dy) from the apex. Up to α = 90° a cone is convex and what is in it lies between
    two heights, the roots of (A + gz)² = cos²α (dx² + dy² + z²), checked for rounding; beyond, they are those
    of the ball, and whether a centre is inside is for `in_cone` to say.
    """
    flat = dx * dx + dy * dy
    high = cone.radius * cone.radius - flat
    if high < 0.0:
        return 0, 0
    high = math.sqrt(high)
    low = -high
    if cone.cosine >= 0.0:
        up, along = cone.gaze[2], dx * cone.gaze[0] + dy * cone.gaze[1]
        squared = cone.cosine * cone.cosine
        a, half_b, c = up * up - squared, along * up, along * along - squared * flat
        root = half_b * half_b - a * c
        if a < -_SLACK:
            if root < -_SLACK:
                return 0, 0
            root = math.sqrt(max(root, 0.0))
            low, high = max(low, (root - half_b) / a), min(high, -(root + half_b) / a)
        elif a > _SLACK and root >= 0.0:
            if up > 0.0:
                low = max(low, (math.sqrt(root) - half_b) / a)
            else:
                high = min(high, -(math.sqrt(root) + half_b) / a)
    first = math.floor(cone.apex[2] + low - 0.5)
    last = math.floor(cone.apex[2] + high - 0.5) + 2
    first, last = max(first, 0), min(last, layers)
    if cone.cosine >= 0.0:
        while first < last and not in_cone(cone, dx, dy, first + 0.5 - cone.apex[2]):
            first += 1
        while first < last and not in_cone(cone, dx, dy, last - 0.5 - cone.apex[2]):
            last -= 1
    return first, last


@inlined_kernel
def _seen(cone, size, i, j, k, sight):
    """Whether nothing believed covered stands between the apex and the centre of a voxel."""
    if sight is None:
        return True
    mean, crossed, entered = sight
    x, y, z = i + 0.5 - cone.apex[0], j + 0.5 - cone.apex[1], k + 0.5 - cone.apex[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length <= 1.0:
        return True
    start, direction = (cone.apex[0], cone.apex[1], cone.apex[2]), (x / length, y / length, z / length)
    _, n, _ = cast_ray(mean, STOP_AT_COVERED, size, start, direction, length, False, 1, crossed, entered)
    return crossed[n - 1] == (i * size[1] + j) * size[2] + k


@inlined_kernel
def _visible(cone, size, i, j, k, sight):
    """Whether a voxel of a column's span is visible."""
    dx, dy, dz = i + 0.5 - cone.apex[0], j + 0.5 - cone.apex[1], k + 0.5 - cone.apex[2]
    return (cone.cosine >= 0.0 or in_cone(cone, dx, dy, dz)) and _seen(cone, size, i, j, k, sight)


@inlined_kernel
def _span(cone, axis, size):
    """First and one past the last index along an axis whose centres may lie in a cone.

    No direction in the cone comes nearer to the axis than its angle from the gaze less α.
    """
    half = math.acos(min(max(cone.cosine, -1.0), 1.0))
    angle = math.acos(min(max(cone.gaze[axis], -1.0), 1.0))
    ahead = cone.radius * max(math.cos(max(angle - half, 0.0)), 0.0)
    behind = cone.radius * max(math.cos(max(math.pi - angle - half, 0.0)), 0.0)
    first, last = math.floor(cone.apex[axis] - behind - 0.5), math.floor(cone.apex[axis] + ahead + 0.5)
    return max(first, 0), min(last + 1, size)


@lean_kernel
def mark_cone(cone, size, sight, marks):
    """Add the voxels that are visible in a cone to those marked (RochaMI, eqs. 5 and 8).

    Args:
        cone: A CONE.
        size: (X, Y, Z) voxels.
        sight: None, or what hides voxels.
        marks: (V,) uint8, set to 1 where a voxel is visible.
    """
    first_x, last_x = _span(cone, 0, size[0])
    first_y, last_y = _span(cone, 1, size[1])
    for i in range(first_x, last_x):
        for j in range(first_y, last_y):
            first, last = _column_span(cone, i + 0.5 - cone.apex[0], j + 0.5 - cone.apex[1], size[2])
            for k in range(first, last):
                if _visible(cone, size, i, j, k, sight):
                    marks[np.uint32((i * size[1] + j) * size[2] + k)] = 1


@lean_kernel
def visible_bits(cone, size, precision, known_precision, sight, marks):
    """Entropy that a cone covers, and how much of it marked voxels cover, too (RochaMI, eqs. 7 and 10).

    Args:
        cone: A CONE.
        size: (X, Y, Z) voxels.
        precision: (V,) float32 1/σ².
        known_precision: 1/σ² of a voxel that counts as known.
        sight: None, or what hides voxels.
        marks: (V,) uint8, 1 for the voxels that the teammates cover.

    Returns:
        (H, I): H(Cⁱ) and I(Cⁱ; Tⁱ) in bits, H ≥ I ≥ 0.
    """
    own, shared, own_growth, shared_growth = 0.0, 0.0, 1.0, 1.0
    first_x, last_x = _span(cone, 0, size[0])
    first_y, last_y = _span(cone, 1, size[1])
    for i in range(first_x, last_x):
        for j in range(first_y, last_y):
            first, last = _column_span(cone, i + 0.5 - cone.apex[0], j + 0.5 - cone.apex[1], size[2])
            for k in range(first, last):
                if _visible(cone, size, i, j, k, sight):
                    voxel = np.uint32((i * size[1] + j) * size[2] + k)
                    ratio = max(known_precision / precision[voxel], 1.0)
                    if marks[voxel] > 0:
                        shared_growth *= ratio
                    else:
                        own_growth *= ratio
                    if own_growth > _FOLD_ABOVE or shared_growth > _FOLD_ABOVE:
                        own, shared = own + math.log2(own_growth), shared + math.log2(shared_growth)
                        own_growth, shared_growth = 1.0, 1.0
    own, shared = own + math.log2(own_growth), shared + math.log2(shared_growth)
    return 0.5 * (own + shared), 0.5 * shared


@lean_kernel
def marked_bits(precision, known_precision, marks):
    """Entropy that the marked voxels cover together: H(T), or a team's without one (RochaMI, eq. 9)."""
    bits, growth = 0.0, 1.0
    for voxel in range(len(marks)):
        if marks[voxel] > 0:
            growth *= max(known_precision / precision[voxel], 1.0)
            if growth > _FOLD_ABOVE:
                bits, growth = bits + math.log2(growth), 1.0
    return 0.5 * (bits + math.log2(growth))


@lean_kernel
def expected_scan_bits(
    mean, precision, size, voxel_size_m, viewpoint, yaw_offsets, pitch_offsets, sight, cones, scratch
):
    """Bits that a scan from a viewpoint is expected to take from the robot's map.

    Rays go through the belief like those of a scan, until something believed covered; where that is too
    near for the sensor, they bring nothing. A voxel that nobody
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
            length, n, end = cast_ray(
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
            if end != OPEN and range_m < sight.min_range_m:
                continue
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
