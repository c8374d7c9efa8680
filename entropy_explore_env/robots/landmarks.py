"""Landmarks that a robot chooses in its own map, and what sighting them again says of its pose.

A landmark is a point of the world that a scan hit. The robot knows it as it saw it first, from where it
believed to be: so its place is off by the error of the pose at that scan, and sighting it again says nothing
of that error, only of what was added since:

    e = F e₀ + w,   Q = cov w = Σ - F Σ₀ Fᵀ,   z - h(x̂) = H w + v - v₀

with Σ₀ and e₀ of the scan that chose it, F the motion since then and H of `correct_estimate`. The gain is
Q Hᵀ S⁻¹ with S = H Q Hᵀ + R: eqs. 14-16 of Sujan, where the uncertainty of the landmark's own place would
otherwise count as independent of the pose's, and make a robot surer the longer it stands. R is the noise of
this sighting, and that of the first one once more for each sighting since, as it is the same in all.
"""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.robots.pose_covariance import (
    gain_along,
    keep_positive,
    length,
    lessen,
    sight_axes,
    spread_yaw_error,
    within_half_turn,
)
from entropy_explore_env.robots.ranges import (
    COUNT,
    FLAG,
    PLACE_OR_ZERO,
    SIGNED,
    SPREAD,
    Values,
    ranged_type,
)

LANDMARK = ranged_type(
    [
        ("place", "f8", PLACE_OR_ZERO, (3,)),  # in the world
        ("believed", "f8", SIGNED, (3,)),  # where the robot saw it first
        ("seen_from", "f8", PLACE_OR_ZERO, (3,)),  # where it believed to be then
        ("covariance", "f8", SPREAD, (4, 4)),  # of the pose then
        ("score", "f8", Values(0.0, 2.0)),  # eq. 17
        ("sightings", "i8", COUNT),  # after the first one
        ("used", "?", FLAG),
    ],
)
"""A landmark of a robot's own map, or a free place for one."""
_ROUNDING = 1e-9
"""Share of a variance that counts as nothing."""


@lean_kernel
def added_since(landmark, here, covariance, matrices):
    """Fill in Q, the covariance of what was added to a pose's error since a landmark was chosen.

    Args:
        here: (x, y, z), where the robot believes to be.
        covariance: (4, 4) float64, Σ, of that pose.
        matrices: (2, 4, 4) float64; the first is filled in, the second is scratch space.

    Returns:
        Whether Q is a covariance; it is none where other landmarks have taken back more since.
    """
    added = matrices[0]
    for row in range(4):
        for column in range(4):
            added[row, column] = -landmark.covariance[row, column]
    x, y = here[0] - landmark.seen_from[0], here[1] - landmark.seen_from[1]
    spread_yaw_error(added, -y, x)
    for row in range(4):
        for column in range(4):
            added[row, column] += covariance[row, column]
    return is_covariance(added, covariance, matrices[1])


@lean_kernel
def is_covariance(matrix, scale, factors):
    """Return whether a symmetric (4, 4) has no negative eigenvalue, up to rounding: by Cholesky factors.

    Args:
        matrix: (4, 4) float64.
        scale: (4, 4) float64, whose diagonal says how large rounding errors may be.
        factors: (4, 4) float64, scratch space.
    """
    for row in range(4):
        for column in range(4):
            factors[row, column] = matrix[row, column]
    for column in range(4):
        least = _ROUNDING * scale[column, column]
        pivot = factors[column, column]
        if pivot < -least:
            return False
        for row in range(column + 1, 4):
            if pivot <= least:
                if abs(factors[row, column]) > math.sqrt(_ROUNDING * scale[column, column] * scale[row, row]):
                    return False
                continue
            share = factors[row, column] / pivot
            for other in range(column + 1, 4):
                factors[row, other] -= share * factors[column, other]
    return True


@lean_kernel
def correct_by_landmark(estimate, landmark, seen, sigmas, matrices):
    """Correct an estimate by sighting a landmark of the robot's own map again.

    Args:
        landmark: LANDMARK; its sighting is counted.
        seen: (x, y, z), from the robot to the landmark as measured, turned by the yaw that it believes.
        sigmas: (along, direction), standard deviations of a sighting: metres, radians.

    Returns:
        Whether it said anything.
    """
    here = (
        estimate.place[0] + estimate.error[0],
        estimate.place[1] + estimate.error[1],
        estimate.place[2] + estimate.error[2],
    )
    if not added_since(landmark, here, estimate.covariance, matrices):
        return False
    believed = landmark.believed
    expected = (
        believed[0] - estimate.place[0] - estimate.error[0],
        believed[1] - estimate.place[1] - estimate.error[1],
        believed[2] - estimate.place[2] - estimate.error[2],
    )
    taken = take_landmark(estimate.covariance, landmark, seen, expected, sigmas, matrices)
    for number in range(4):
        estimate.error[number] -= taken[number]
    estimate.error[3] = within_half_turn(estimate.error[3])
    landmark.sightings += 1
    return True


@lean_kernel
def foresee_landmark(covariance, landmark, here, away, sigmas, matrices):
    """Take in what sighting a landmark of the robot's own map again should say, where it is as believed.

    `away` (x, y, z) leads from `here`, where the robot believes to be, to where it believes the landmark is.
    """
    if added_since(landmark, here, covariance, matrices):
        take_landmark(covariance, landmark, away, away, sigmas, matrices)


@lean_kernel
def take_landmark(covariance, landmark, seen, expected, sigmas, matrices):
    """Lower a covariance by a sighting of a landmark; returns (x, y, z, yaw), to be taken from the estimate.

    The sighting tells of what was added since the landmark was chosen: `added_since` has filled `matrices`,
    of which the first is changed. Other arguments as of `correct_by_landmark`.
    """
    added, believed, first = matrices[0], landmark.believed, landmark.seen_from
    far_m = length((believed[0] - first[0], believed[1] - first[1], believed[2] - first[2]))
    ahead, side, up, distance = sight_axes(seen)
    often = 1.0 + landmark.sightings
    across = max(distance, length(expected)) * sigmas[1]
    # the noise of the first sighting lay along other axes: the larger of its parts counts along all
    first_most = often * max(sigmas[0], far_m * sigmas[1]) ** 2
    along = sigmas[0] * sigmas[0] + first_most
    aside = across * across + first_most
    off = seen[0] - expected[0], seen[1] - expected[1], seen[2] - expected[2]
    taken = (0.0, 0.0, 0.0, 0.0)
    taken = take_relative(covariance, added, ahead, expected, off, along, taken)
    taken = take_relative(covariance, added, side, expected, off, aside, taken)
    return take_relative(covariance, added, up, expected, off, aside, taken)


@inlined_kernel
def take_relative(covariance, added, axis, expected, off, variance, taken):
    """Take in what a sighting says along one axis of what was added, Q: as `correct_along`."""
    gains, spread, taken = gain_along(added, axis, expected, off, variance, taken)
    lessen(covariance, gains, spread)
    keep_positive(covariance)
    lessen(added, gains, spread)
    return taken
