"""What a mission's robots believe of their poses: when that changes, and what it does to drives and scans.

The team drives and scans in the world; a robot plans, fuses, announces and observes where it believes to be.
An estimate changes at events: where a robot scans, decides under way, or is stopped by a fault. A drive
follows its path as the robot's estimate had it when it departed: what drifts meanwhile is made good by the
next decision that changes its viewpoint. A robot knows that it is in the workspace, so an estimate beyond it
is taken to the nearest place in it. Where no robot of the scenario drifts `TeamLocalization` is None, and
nothing of all this is compiled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import point
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.poses import copy_numbers, pose_at
from entropy_explore_env.randomness import Stream, splitmix_states
from entropy_explore_env.robots.channel import BITS_PER_COVARIANCE
from entropy_explore_env.robots.localization import (
    advance_estimate,
    believed_point,
    believed_yaw,
    pack_covariance,
    point_in_world,
    weigh_by_covariance,
)
from entropy_explore_env.robots.measured_rays import trace_measurements
from entropy_explore_env.robots.pose_covariance import within_half_turn

_INSIDE = 1e-6
"""How far within the workspace's upper faces an estimate is taken, in edges: these belong to no voxel."""


class TeamLocalization(NamedTuple):
    """What one mission's robots believe of their poses."""

    params: np.ndarray
    """(A,) LOCALIZATION_PARAMS."""
    estimates: np.ndarray
    """(A,) ESTIMATE, a slice of MissionState."""
    fiducials: np.ndarray
    """(F, 3) float64, places in the world, likewise."""
    landmarks: np.ndarray
    """(A, L) LANDMARK, of robots' own maps, likewise."""


def begin_estimates(seed: int, episode: int, poses: np.ndarray, estimates: np.ndarray) -> None:
    """Let robots know exactly where they start, poses (A, 5), and set their random states.

    The (A,) ESTIMATE are zeros, or empty where no robot drifts.
    """
    if len(estimates):
        estimates["place"], estimates["yaw"], estimates["scan_pose"] = poses[:, :3], poses[:, 3], poses
        for name, stream in (("drift_rng", Stream.LOCALIZATION), ("sighting_rng", Stream.SIGHTINGS)):
            estimates[name][:, 0] = splitmix_states(seed, episode, stream, len(poses))


def pose_errors(estimates: np.ndarray) -> list[tuple[float, float]]:
    """Return how wrong one mission's robots were about their poses at the latest changes of their estimates.

    Returns:
        Of each robot, the distance in metres between where it believed to be and where it was, and what its
        yaw was off in radians, ≥ 0. Lists: infos tell them after every step.
    """
    return [(math.sqrt(x * x + y * y + z * z), abs(yaw)) for x, y, z, yaw in estimates["error"].tolist()]


@lean_kernel
def localization_of(params, estimates, fiducials, landmarks, mission):
    """Return the TeamLocalization of a mission; None where no robot drifts."""
    if params is None:  # known while compiling: nothing of the rest is compiled
        return None
    return TeamLocalization(params, estimates[mission], fiducials[mission], landmarks[mission])


@lean_kernel
def estimate_of(localization, index):
    """Return the ESTIMATE of a robot; None where no robot drifts."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return None
    return localization.estimates[index]


@lean_kernel
def estimate_in(estimates, mission, index):
    """Return the ESTIMATE of a robot of a mission, out of (E, A) ESTIMATE; None where there are none."""
    if estimates is None:  # known while compiling: nothing of the rest is compiled
        return None
    return estimates[mission, index]


@lean_kernel
def pose_variance(estimate):
    """Return (place, yaw): variance of a robot's place, summed over axes in m², and of its yaw in rad²."""
    if estimate is None:  # known while compiling: nothing of the rest is compiled
        return 0.0, 0.0
    covariance = estimate.covariance
    return covariance[0, 0] + covariance[1, 1] + covariance[2, 2], covariance[3, 3]


@lean_kernel
def believed_pose(estimate, params, pose):
    """Return the pose (x, y, z, yaw, pitch), in the workspace, where a robot at a true one believes to be.

    Args:
        pose: Of the robot, in the world.
    """
    if estimate is None:  # known while compiling: nothing of the rest is compiled
        return pose[0], pose[1], pose[2], pose[3], pose[4]
    x, y, z = believed_point(estimate, point(pose))
    return (
        into_workspace(params, 0, x),
        into_workspace(params, 1, y),
        into_workspace(params, 2, z),
        believed_yaw(estimate, pose[3]),
        pose[4],
    )


@lean_kernel
def into_workspace(params, axis, number):
    """Return a coordinate in metres: itself, if it is in the workspace, or the nearest one that is."""
    low, edge = params.origin_m[axis], params.voxel_size_m
    high = low + params.size[axis] * edge
    if not number >= low:  # nor is NaN
        return low
    if number >= high:
        inside = high - _INSIDE * edge
        return inside if inside < high else high - 0.5 * edge
    return number


@lean_kernel
def note_motion(localization, params, robot, index, time_s):
    """Carry a robot's estimate on to where it is at an event."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return
    estimate = localization.estimates[index]
    pose = pose_at(params, robot, time_s)
    advance_estimate(estimate, localization.params[index], point(pose), pose[3], robot.distance_m)
    keep_in_workspace(estimate, params)


@lean_kernel
def keep_in_workspace(estimate, params):
    """Bring an estimate back into the workspace, at the event at which it changes."""
    for axis in range(3):
        believed = estimate.place[axis] + estimate.error[axis]
        inside = into_workspace(params, axis, believed)
        if inside != believed:
            estimate.error[axis] = inside - estimate.place[axis]


@lean_kernel
def choice_into_world(estimate, params, robot, choice, time_s):
    """Turn what a robot chose, where it believes to be, into a drive through the world from where it is.

    Args:
        robot: ROBOT, before it departs; its target becomes the viewpoint as the robot means it.
        choice: CHOICE, changed in place.
    """
    copy_numbers(choice.viewpoint, robot.target, 5)
    if estimate is None:  # known while compiling: nothing of the rest is compiled
        return
    copy_numbers(robot.goal, choice.pose, 5)
    if robot.under_way:
        copy_numbers(pose_at(params, robot, time_s), choice.pose, 5)
    copy_numbers(point_in_world(estimate, point(choice.viewpoint)), choice.viewpoint, 3)
    choice.viewpoint[3] = within_half_turn(choice.viewpoint[3] - estimate.error[3])
    for number in range(max(choice.waypoints, 1)):
        copy_numbers(point_in_world(estimate, point(choice.path[number])), choice.path[number], 3)


@lean_kernel
def believe_scan(localization, index, scan, sensor, scene, pose):
    """Let a scan be what its robot takes it for: measured from where it believes to be, and less precise.

    Args:
        scan: Scan as it was taken in the world; its rays are turned, and their voxels those of the belief.
        sensor: SENSOR_PARAMS of the robot.
        pose: (x, y, z), where the robot believes to be, in grid units.
    """
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return
    estimate = localization.estimates[index]
    along, across = math.cos(estimate.error[3]) - 1.0, math.sin(estimate.error[3])
    for number in range(len(scan.rays)):
        ray = scan.rays[number]
        x, y = ray.direction[0], ray.direction[1]
        ray.direction[0] += along * x - across * y
        ray.direction[1] += across * x + along * y
    trace_measurements(scan, sensor, scene.size, scene.voxel_size_m, pose, scene.occupied)
    pack_covariance(estimate.covariance, estimate.packed)
    weigh_by_covariance(scan.rays, len(scan.rays), estimate.packed, scene.voxel_size_m)


@lean_kernel
def note_scan_pose(localization, index, pose):
    """Keep where a robot believes to have scanned, and count how wrong it was."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return
    estimate = localization.estimates[index]
    error = estimate.error
    copy_numbers(pose, estimate.scan_pose, 5)
    estimate.squared_m2 += error[0] * error[0] + error[1] * error[1] + error[2] * error[2]
    estimate.squared_rad2 += error[3] * error[3]


@lean_kernel
def believed_scan_pose(localization, robot, index):
    """Return (x, y, z, yaw, pitch) where a robot believes to have taken its latest scan."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return whole_pose(robot.scan_pose)
    return whole_pose(localization.estimates[index].scan_pose)


@lean_kernel
def whole_pose(pose):
    """Return (x, y, z, yaw, pitch) from an array (5,)."""
    return pose[0], pose[1], pose[2], pose[3], pose[4]


@lean_kernel
def note_covariance(localization, index, covariances, slot):
    """Put the covariance of a robot's latest scan beside a batch of its measurements, if batches have one.

    The slot is the index of the batch among the covariances, a number or a tuple.
    """
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return
    packed = localization.estimates[index].packed
    copy_numbers(packed, covariances[slot], len(packed))


@lean_kernel
def weigh_batch(localization, covariances, slot, scan, count, voxel_size_m):
    """Lower the precision of a batch's measurements by the covariance beside it, if batches have one."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return
    weigh_by_covariance(scan.rays, count, covariances[slot], voxel_size_m)


@lean_kernel
def covariance_bits(localization):
    """Return what the covariance of its sender's pose adds to a batch of measurements."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return 0
    return BITS_PER_COVARIANCE
