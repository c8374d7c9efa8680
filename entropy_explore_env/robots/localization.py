"""A robot's estimate of its pose: how it drifts, what sightings of landmarks take back, and scans by it.

The estimate x̂ of the pose x = (x, y, z, yaw) comes with its covariance Σ. Between two events at which the
estimate changes, the robot believes that it is where a rigid motion takes its true pose: a turn by the error
of its yaw about the place of the latest event, and the error of its place there. So what is kept is that
place and the error e = x̂ - x; with e = 0 every pose is bit for bit what it is. Map frame, metres, radians.
"""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type
from entropy_explore_env.randomness import draw_gaussian
from entropy_explore_env.robots.pose_covariance import (
    correct_by_sighting,
    drift_variances,
    sight_axes,
    spread_yaw_error,
    turn_between,
    within_half_turn,
)
from entropy_explore_env.robots.ranges import (
    ANGLE,
    COUNT,
    HUGE,
    MOST,
    PLACE,
    POSE,
    SPREAD,
    Values,
    ranged_type,
)

LOCALIZATION_PARAMS = record_type(
    [
        # variance that a metre driven adds: of x and y, of z, of the yaw
        ("xy_per_m", "f8"),
        ("z_per_m", "f8"),
        ("yaw_per_m", "f8"),
        ("yaw_per_rad", "f8"),  # the same of the yaw, by a radian turned
        # of sightings
        ("range_m", "f8"),
        ("range_sigma_m", "f8"),
        ("bearing_sigma_rad", "f8"),
        ("half_yaw_rad", "f8"),  # half of the sensor's field of view
        ("half_pitch_rad", "f8"),
        # of landmarks in its own map
        ("landmark_score", "f8"),
        ("landmarks_apart_m", "f8"),
    ],
)
"""How a robot localises itself, in the units of `settings.localization`, standard deviations squared."""

COVARIANCE_NUMBERS = 10
"""Different numbers of a covariance of four."""

ESTIMATE = ranged_type(
    [
        ("place", "f8", PLACE, (3,)),  # where the robot truly was at the latest event
        ("yaw", "f8", ANGLE),  # its true yaw then
        ("driven_m", "f8", Values(0.0, MOST)),  # what it had driven by then
        ("error", "f8", Values("error_low", "error_high"), (4,)),  # estimate less truth: x, y, z, yaw
        ("covariance", "f8", SPREAD, (4, 4)),  # of x, y, z, yaw, as the robot holds it to be
        # the covariance at its latest scan, as batches of measurements carry it
        ("packed", "f8", SPREAD, (COVARIANCE_NUMBERS,)),
        # where it believes to have taken its latest scan: x, y, z, yaw, pitch
        ("scan_pose", "f8", POSE, (5,)),
        # random states of drift, and of errors of sightings, so that fiducials do not change the drift
        ("drift_rng", "u8", None, (1,)),
        ("sighting_rng", "u8", None, (1,)),
        # counted from the mission's start
        ("sightings", "i8", COUNT),
        ("squared_m2", "f8", Values(0.0, HUGE)),  # squared error of the place, summed over scans
        ("squared_rad2", "f8", Values(0.0, HUGE)),  # the same of the yaw
    ],
)
"""What a robot believes of its pose, and how wrong that is: the robot itself sees no error."""


@lean_kernel
def believed_point(estimate, position):
    """Return (x, y, z) at which a robot believes a point of the world to be, from where it believes to be.

    Args:
        position: (x, y, z) in the world.
    """
    if estimate is None:  # known while compiling: nothing of the rest is compiled
        return position[0], position[1], position[2]
    along, across = math.cos(estimate.error[3]) - 1.0, math.sin(estimate.error[3])
    x, y = position[0] - estimate.place[0], position[1] - estimate.place[1]
    return (
        position[0] + (along * x - across * y) + estimate.error[0],
        position[1] + (across * x + along * y) + estimate.error[1],
        position[2] + estimate.error[2],
    )


@lean_kernel
def point_in_world(estimate, position):
    """Return (x, y, z) in the world of a point that a robot means: `believed_point` turns it back."""
    if estimate is None:  # known while compiling: nothing of the rest is compiled
        return position[0], position[1], position[2]
    along, across = math.cos(estimate.error[3]) - 1.0, math.sin(estimate.error[3])
    x, y = position[0] - estimate.error[0], position[1] - estimate.error[1]
    from_x, from_y = x - estimate.place[0], y - estimate.place[1]
    return (
        x + (along * from_x + across * from_y),
        y + (along * from_y - across * from_x),
        position[2] - estimate.error[2],
    )


@lean_kernel
def believed_yaw(estimate, yaw):
    """Return the yaw that a robot believes to have, or to look at."""
    if estimate is None:  # known while compiling: nothing of the rest is compiled
        return yaw
    return yaw + estimate.error[3]


@lean_kernel
def advance_estimate(estimate, params, place, yaw, driven_m):
    """Carry an estimate on to where a robot has driven: what it believes to have driven, and drift.

        x̂' = x̂ ⊕ motion + q,   Σ' = F Σ Fᵀ + Q,   q ~ N(0, Q)

    F turns an error of the yaw into one of the place: ∂x̂'/∂yaw = ẑ × (x̂' - x̂). Q is diagonal: a variance for
    each metre driven and one for each radian turned since the latest event. The yaw's drift of one piece of a
    drive turns only what comes after it.

    Args:
        place: (x, y, z), where the robot truly is.
        yaw: Its true yaw.
        driven_m: What it has driven since the mission's start.
    """
    error, covariance = estimate.error, estimate.covariance
    x, y = place[0] - estimate.place[0], place[1] - estimate.place[1]
    turned = turn_between(estimate.yaw, yaw)
    metres = max(driven_m - estimate.driven_m, 0.0)
    along, across = math.cos(error[3]) - 1.0, math.sin(error[3])
    error[0] += along * x - across * y
    error[1] += across * x + along * y
    spread_yaw_error(covariance, -(across * x + (along + 1.0) * y), (along + 1.0) * x - across * y)
    xy, z, heading = drift_variances(params, metres, turned)
    rng = estimate.drift_rng
    add_drift(error, covariance, 0, xy, rng)
    add_drift(error, covariance, 1, xy, rng)
    add_drift(error, covariance, 2, z, rng)
    add_drift(error, covariance, 3, heading, rng)
    error[3] = within_half_turn(error[3])
    for axis in range(3):
        estimate.place[axis] = place[axis]
    estimate.yaw, estimate.driven_m = yaw, driven_m


@inlined_kernel
def add_drift(error, covariance, number, variance, rng):
    """Draw a drift of this variance into one of the four numbers; drawn from `rng` only if there is any."""
    if variance > 0.0:
        error[number] += math.sqrt(variance) * draw_gaussian(rng)
        covariance[number, number] += variance


@lean_kernel
def sighting_error(relative, range_sigma_m, bearing_sigma_rad, rng):
    """Return (x, y, z), a drawn error of a sighting: along the sight; sideways and up with the distance."""
    ahead, side, up, distance = sight_axes(relative)
    along = range_sigma_m * draw_gaussian(rng)
    aside = distance * bearing_sigma_rad * draw_gaussian(rng)
    above = distance * bearing_sigma_rad * draw_gaussian(rng)
    return (
        along * ahead[0] + aside * side[0] + above * up[0],
        along * ahead[1] + aside * side[1] + above * up[1],
        along * ahead[2] + aside * side[2] + above * up[2],
    )


@lean_kernel
def correct_estimate(estimate, seen, expected, range_sigma_m, bearing_sigma_rad):
    """Correct an estimate by a sighting of a landmark: the extended Kalman filter of Sujan, eqs. 14-16.

    The paper estimates points of the scene with it; the pose as its state, and landmarks whose places are
    known, are ours. In e = x̂ - x, the error of the estimate, the sighting says

        z - h(x̂) = seen - expected = H e + v,   H = [I | ẑ × expected],   v ~ N(0, R)              (14, 15)
        K = Σ Hᵀ (H Σ Hᵀ + R)⁻¹,   x̂' = x̂ - K (z - h(x̂)),   Σ' = (I - K H) Σ                       (16)

    R is diagonal along the line of sight, sideways and up, and the bearing's part of it grows with the
    distance, seen or expected, whichever is larger. So these three numbers are taken in one after the other,
    which comes to the same without an inverse.

    Args:
        seen: (x, y, z), from the robot to the landmark as measured, turned by the yaw that it believes.
        expected: (x, y, z), from where the robot believes to be to where the landmark is.
        range_sigma_m: Standard deviation of `seen` along it, > 0.
        bearing_sigma_rad: Of its direction, > 0.
    """
    taken = correct_by_sighting(estimate.covariance, seen, expected, range_sigma_m, bearing_sigma_rad)
    for number in range(4):
        estimate.error[number] -= taken[number]
    estimate.error[3] = within_half_turn(estimate.error[3])
    estimate.sightings += 1


@lean_kernel
def pack_covariance(covariance, packed):
    """Fill (10,) with the different numbers of a covariance (4, 4), row by row from the diagonal on."""
    place = 0
    for row in range(4):
        for column in range(row, 4):
            packed[place] = covariance[row, column]
            place += 1


@lean_kernel
def weigh_by_covariance(rays, count, packed, voxel_size_m):
    """Lower the precision of the first `count` rays by how uncertain the pose is that they come from.

        σ² = σ(d)² + tr(J Σ Jᵀ) / vsz²,   J = [I | d ẑ × u]

    J Σ Jᵀ is the covariance of the measured point p = x + d u, the pose's own moved to the point by the lever
    arm d (Sujan, eqs. 19-21, merge the covariances of points), and its trace the mean square of how far the
    point is off. Measured coverage rises from 0 to 1 along an edge of a voxel, so in coverage that is / vsz².
    The trace holds uᵀΣu, all that counts where a surface is met square on. But the yaw moves a point
    at right angles to the ray, uᵀ(ẑ × u) = 0, and would drop out of that, though it is what places far
    surfaces wrong most. Where a surface is met at a slant of 45°, sideways errors move it along the ray as
    much as those along it; so errors of all directions count alike.

    Args:
        count: How many of them.
        packed: (10,) float64, Σ as `pack_covariance` writes it.
    """
    place = packed[0] + packed[4] + packed[7]
    x_yaw, y_yaw, yaw = packed[3], packed[6], packed[9]
    share = 1.0 / (voxel_size_m * voxel_size_m)
    for index in range(count):
        ray = rays[index]
        x, y = ray.direction[0] * ray.range_m, ray.direction[1] * ray.range_m
        off = place + 2.0 * (x * y_yaw - y * x_yaw) + (x * x + y * y) * yaw
        if off > 0.0:
            ray.precision = ray.precision / (1.0 + ray.precision * off * share)
