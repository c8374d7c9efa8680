"""The covariance of a pose (x, y, z, yaw): what motion does to it, what sightings of landmarks take from it.

Map frame, metres, radians. What covariances become does not depend on what a sighting measures, so that a
robot can tell beforehand how well it will know its pose.
"""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

_NO_DISTANCE_M = 1e-9
"""What is nearer has no direction, and is taken for this far away."""
_ROUNDING = 1e-9
"""Share of a variance that sums of products may be off by."""
_LEVEL = 1e-9
"""A direction with a shorter horizontal part is vertical: any horizontal one is sideways to it."""


@inlined_kernel
def within_half_turn(angle):
    """Return an angle in [-π, π]: itself, if it is, or what is left of it without whole turns."""
    if abs(angle) <= math.pi:
        return angle
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@lean_kernel
def spread_yaw_error(covariance, to_x, to_y):
    """Make F Σ Fᵀ of Σ, in place; F is the identity but for ∂x/∂yaw = `to_x` and ∂y/∂yaw = `to_y`."""
    for column in range(4):
        by_yaw = covariance[3, column]
        covariance[0, column] += to_x * by_yaw
        covariance[1, column] += to_y * by_yaw
    for row in range(4):
        by_yaw = covariance[row, 3]
        covariance[row, 0] += to_x * by_yaw
        covariance[row, 1] += to_y * by_yaw
    for row in range(1, 4):
        for column in range(row):  # equal but for rounding
            covariance[row, column] = covariance[column, row]


@inlined_kernel
def drift_variances(params, metres, turned):
    """Return (of x and of y, of z, of the yaw): the variances that metres driven and radians turned add."""
    return (
        params.xy_per_m * metres,
        params.z_per_m * metres,
        params.yaw_per_m * metres + params.yaw_per_rad * turned,
    )


@inlined_kernel
def turn_between(yaw, other):
    """Return the radians of the shortest turn from one yaw to another, ≥ 0."""
    return abs((other - yaw + math.pi) % (2.0 * math.pi) - math.pi)


@lean_kernel
def in_field_of_view(params, yaw, pitch, away):
    """Return whether a landmark, (x, y, z) from the robot, is in the field of view of a gaze."""
    x, y, z = away
    turn = math.atan2(y, x) - yaw
    down = math.atan2(-z, math.sqrt(x * x + y * y))
    # A view that is tilted past the vertical has the landmark behind it, at a pitch beyond a right angle.
    return within_half_view(params, turn, down - pitch) or within_half_view(
        params, turn + math.pi, math.pi - down - pitch
    )


@lean_kernel
def within_half_view(params, turn, tilt):
    """Return whether a direction this many radians beside and below the gaze is in the field of view."""
    aside, down = abs(within_half_turn(turn)), abs(within_half_turn(tilt))
    return aside <= params.half_yaw_rad and down <= params.half_pitch_rad


@inlined_kernel
def length(vector):
    """Return the length of (x, y, z)."""
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


@inlined_kernel
def sight_axes(relative):
    """Return (ahead, sideways, up, distance): unit vectors at right angles, the first along the sight."""
    x, y, z = relative
    distance = max(length(relative), _NO_DISTANCE_M)
    ahead = x / distance, y / distance, z / distance
    level = math.sqrt(ahead[0] * ahead[0] + ahead[1] * ahead[1])
    side = (1.0, 0.0, 0.0)
    if level > _LEVEL:
        side = -ahead[1] / level, ahead[0] / level, 0.0
    up = (
        ahead[1] * side[2] - ahead[2] * side[1],
        ahead[2] * side[0] - ahead[0] * side[2],
        ahead[0] * side[1] - ahead[1] * side[0],
    )
    return ahead, side, up, distance


@inlined_kernel
def correct_along(covariance, axis, expected, off, variance, taken):
    """Correct a pose by what a sighting says along one axis; returns `taken`: see `gain_along`."""
    gains, spread, taken = gain_along(covariance, axis, expected, off, variance, taken)
    lessen(covariance, gains, spread)
    keep_positive(covariance)
    return taken


@inlined_kernel
def gain_along(prior, axis, expected, off, variance, taken):
    """Return (gains, spread, taken): what a sighting says along one axis, by a Kalman filter.

    Args:
        prior: (4, 4) float64, covariance of the errors of which the sighting tells.
        expected: As of `correct_by_sighting`.
        off: What was seen less what was expected.
        variance: Of what was seen, along the axis.
        taken: (x, y, z, yaw), what the axes before have taken from the estimate.

    Returns:
        Gains (4,) times the spread, which is the variance of `off` along the axis, and `taken` with what this
        axis takes. Gains are 0 where the prior is so uncertain that numbers do not hold it.
    """
    h = axis[0], axis[1], axis[2], axis[1] * expected[0] - axis[0] * expected[1]
    gain_0, gain_1 = dot4(prior[0], h), dot4(prior[1], h)
    gain_2, gain_3 = dot4(prior[2], h), dot4(prior[3], h)
    gains = gain_0, gain_1, gain_2, gain_3
    spread = max(dot4(gains, h), 0.0) + variance  # below 0: rounding, or a state from outside
    if not math.isfinite(spread):
        return (0.0, 0.0, 0.0, 0.0), 1.0, taken
    surprise = axis[0] * off[0] + axis[1] * off[1] + axis[2] * off[2] - dot4(taken, h)
    step = surprise / spread
    more = (
        taken[0] + gain_0 * step,
        taken[1] + gain_1 * step,
        taken[2] + gain_2 * step,
        taken[3] + gain_3 * step,
    )
    return gains, spread, more


@inlined_kernel
def lessen(covariance, gains, spread):
    """Take off a covariance (4, 4), in place, what a sighting with these gains has made known."""
    for row in range(4):
        for column in range(4):
            covariance[row, column] -= gains[row] * gains[column] / spread


@lean_kernel
def keep_positive(covariance):
    """Let no combination of errors have a variance below 0, but for rounding, in place.

    What a sighting takes off may be all that was there, to the last digit that numbers hold; what is left
    then is rounding, and no covariance. By Cholesky's factors, column by column: two errors have no more in
    common than the geometric mean of what the errors before leave of their variances. A matrix that is a
    covariance stays as it is.

    Args:
        covariance: (4, 4) float64, symmetric. Below the diagonal it holds the factors meanwhile.
    """
    for number in range(4):
        covariance[number, number] = max(covariance[number, number], 0.0)
    for column in range(4):
        least = _ROUNDING * covariance[column, column]
        left = left_by_those_before(covariance, column, column)
        for row in range(column + 1, 4):
            joint = covariance[column, row]
            for before in range(column):
                joint -= covariance[row, before] * covariance[column, before]
            others = left_by_those_before(covariance, row, column)
            if joint * joint > (left + least) * (others + _ROUNDING * covariance[row, row]):
                bounded = math.copysign(math.sqrt(left * others), joint)
                covariance[column, row] += bounded - joint
                joint = bounded
            covariance[row, column] = joint / math.sqrt(left) if left > least else 0.0
    for row in range(1, 4):
        for column in range(row):
            covariance[row, column] = covariance[column, row]


@lean_kernel
def left_by_those_before(covariance, row, column):
    """Return what errors before a column leave of a variance, ≥ 0; their factors lie below the diagonal."""
    left = covariance[row, row]
    for before in range(column):
        left -= covariance[row, before] * covariance[row, before]
    return max(left, 0.0)


@inlined_kernel
def dot4(a, b):
    """Return the sum of the products of four numbers each."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@lean_kernel
def correct_by_sighting(covariance, seen, expected, range_sigma_m, bearing_sigma_rad):
    """Correct a pose by a sighting: three numbers, along the line of sight, sideways and up (eq. 16).

    Args:
        seen: (x, y, z), from the robot to the landmark as measured, turned by the yaw that it believes.
        expected: (x, y, z), from where the robot believes to be to where the landmark is; the same as `seen`
            before the sighting is made.
        range_sigma_m: Standard deviation of `seen` along it, > 0.
        bearing_sigma_rad: Of its direction, > 0.

    Returns:
        (x, y, z, yaw), what the sighting takes from the estimate.
    """
    ahead, side, up, distance = sight_axes(seen)
    sigma = max(distance, length(expected)) * bearing_sigma_rad  # noise may have seen it much too near
    off = seen[0] - expected[0], seen[1] - expected[1], seen[2] - expected[2]
    none = (0.0, 0.0, 0.0, 0.0)
    taken = correct_along(covariance, ahead, expected, off, range_sigma_m * range_sigma_m, none)
    taken = correct_along(covariance, side, expected, off, sigma * sigma, taken)
    return correct_along(covariance, up, expected, off, sigma * sigma, taken)
