"""How well a robot will know its pose at a viewpoint: what the way adds, and what landmarks take back.

The localization error LE of Sujan's rating function (sect. 2.3.5, eq. 23), which the paper leaves open: "the
localization error of the agent along the path to the target", less where the path has promising fiducials.
Landmarks are those of the world, and of the robot's own map, which take back what was added since it chose
them, and no more. In all functions `covariance` is Σ, (4, 4) float64, of x, y, z and yaw;
places are in metres, in the map frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import STOP_AT_COVERED, Line, cast_range, distance_between, point
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.robots.landmarks import foresee_landmark
from entropy_explore_env.robots.pose_covariance import (
    correct_by_sighting,
    drift_variances,
    in_field_of_view,
    spread_yaw_error,
    turn_between,
)

_CARRIER = 1.5
"""Voxel edges: what ends a line of sight so near to a landmark is what the landmark is on."""


class Surveyor(NamedTuple):
    """A robot that localises itself by landmarks, and what it believes to lie between."""

    params: np.ndarray
    """(1,) LOCALIZATION_PARAMS."""
    landmarks_m: np.ndarray
    """(F, 3) float64, map frame."""
    mean: np.ndarray
    """(V,) float32, expected coverage."""
    size: tuple[int, int, int]
    """(X, Y, Z) voxels."""
    origin_m: tuple[float, float, float]
    voxel_size_m: float
    min_range_m: float
    """It sights nothing nearer."""
    scan_every_m: float
    """It scans under way after driving so far, in metres; inf = at the end alone."""
    own: np.ndarray
    """(N,) LANDMARK, of its own map; where they truly are does not matter."""
    matrices: np.ndarray
    """(2, 4, 4) float64, scratch space."""


class Drive(NamedTuple):
    """A drive that a robot may make."""

    pose: np.ndarray
    """(5,) where it believes to be: x, y, z, yaw, pitch."""
    path_m: np.ndarray
    """(N, 3) points to which it drives straight, one after the other; none = it stays."""
    viewpoint: np.ndarray
    """(5,) where it ends; it looks so at every scan on the way."""
    since_scan_m: float
    """What it has driven since its latest scan."""


@lean_kernel
def growth_of_error(covariance, surveyor, drive, lever_m, after):
    """Return LE of a drive (Sujan, eq. 23), in metres: how much less exact measurements at its end will be.

        LE = s(Σ') - s(Σ),   s(Σ)² = Σ_xx + Σ_yy + Σ_zz + L² Σ_ψψ

    s is the root mean square, over all horizontal directions, of how far a point is off that is measured from
    the pose at the distance L, `lever_m`: see `weigh_by_covariance`. Below 0 where landmarks take back more
    than the way adds. Σ' is filled into `after`.
    """
    for row in range(4):
        for column in range(4):
            after[row, column] = covariance[row, column]
    foresee_covariance(after, surveyor, drive)
    return error_of_points(after, lever_m) - error_of_points(covariance, lever_m)


@inlined_kernel
def error_of_points(covariance, lever_m):
    """Return s(Σ) of `growth_of_error`."""
    place = covariance[0, 0] + covariance[1, 1] + covariance[2, 2]
    return math.sqrt(max(place + lever_m * lever_m * covariance[3, 3], 0.0))


@lean_kernel
def foresee_covariance(covariance, surveyor, drive):
    """Turn the covariance of a pose into the one that its robot expects at the end of a drive.

    The estimate changes at each scan: Σ' = F Σ Fᵀ + Q for the motion since the one before, and eq. 16 for
    each landmark that should be in sight. The robot has turned to its viewpoint's gaze by its first scan.
    """
    begin, event = point(drive.pose), point(drive.pose)
    turned = turn_between(drive.pose[3], drive.viewpoint[3])
    metres, left_m = 0.0, surveyor.scan_every_m - drive.since_scan_m
    for number in range(len(drive.path_m)):
        end = point(drive.path_m[number])
        leg_m = distance_between(begin, end)
        done_m = 0.0
        while leg_m - done_m > max(left_m, 0.0):
            done_m += max(left_m, 0.0)
            metres += max(left_m, 0.0)
            share = done_m / leg_m
            here = (
                begin[0] + share * (end[0] - begin[0]),
                begin[1] + share * (end[1] - begin[1]),
                begin[2] + share * (end[2] - begin[2]),
            )
            move_and_sight(covariance, surveyor, drive, event, here, metres, turned)
            event, metres, turned, left_m = here, 0.0, 0.0, surveyor.scan_every_m
        metres += leg_m - done_m
        left_m -= leg_m - done_m
        begin = end
    move_and_sight(covariance, surveyor, drive, event, begin, metres, turned)


@lean_kernel
def move_and_sight(covariance, surveyor, drive, event, here, metres, turned):
    """Carry a covariance on to a scan, and take in the landmarks that should be in sight there.

    The robot drove some metres and turned some radians from an event (x, y, z), the scan before or where the
    drive began, to `here` (x, y, z).
    """
    params = surveyor.params[0]
    spread_yaw_error(covariance, event[1] - here[1], here[0] - event[0])
    xy, z, heading = drift_variances(params, metres, turned)
    covariance[0, 0] += xy
    covariance[1, 1] += xy
    covariance[2, 2] += z
    covariance[3, 3] += heading
    for number in range(len(surveyor.landmarks_m)):
        landmark = surveyor.landmarks_m[number]
        away = landmark[0] - here[0], landmark[1] - here[1], landmark[2] - here[2]
        if should_be_in_sight(surveyor, drive.viewpoint, here, away):
            correct_by_sighting(covariance, away, away, params.range_sigma_m, params.bearing_sigma_rad)
    sigmas = params.range_sigma_m, params.bearing_sigma_rad
    for number in range(len(surveyor.own)):
        own = surveyor.own[number]
        away = own.believed[0] - here[0], own.believed[1] - here[1], own.believed[2] - here[2]
        if should_be_in_sight(surveyor, drive.viewpoint, here, away):
            foresee_landmark(covariance, own, here, away, sigmas, surveyor.matrices)


@lean_kernel
def should_be_in_sight(surveyor, viewpoint, here, away):
    """Return whether a scan should sight a landmark; what is unknown hides nothing.

    It is taken `here` (x, y, z) with the gaze of a viewpoint (5,), and the landmark lies `away` (x, y, z)
    from it.
    """
    params, edge, origin = surveyor.params[0], surveyor.voxel_size_m, surveyor.origin_m
    x, y, z = away
    distance = math.sqrt(x * x + y * y + z * z)
    if distance > params.range_m or distance < max(surveyor.min_range_m, 1e-6):
        return False
    if not in_field_of_view(params, viewpoint[3], viewpoint[4], away):
        return False
    start = (here[0] - origin[0]) / edge, (here[1] - origin[1]) / edge, (here[2] - origin[2]) / edge
    line = Line(start, (x / distance, y / distance, z / distance), distance / edge)
    seen, _, _ = cast_range(surveyor.mean, surveyor.size, line, STOP_AT_COVERED)
    return seen >= line.length - _CARRIER
