"""Decisions, at rest and under way: what a robot has chosen, and whether it can take a new path at its speed.

A robot that decides while it drives (Robot.redecide) is somewhere on its path, at some speed v; the decision
takes no simulated time. Where it chooses the viewpoint that it has, up to `SAME_EDGES` and `SAME_RAD`,
nothing changes: neither its path, nor its times, nor what it announced. Only where a scan under way has shown
that the rest of a planned path is blocked, it takes a new path to the same viewpoint.

A changed decision begins a new drive. The robot could come to rest on its old path after v²/2a, its braking
distance. If the new path is at least as long, and up to there leads at most 45° away from the old one
(`keeps_speed`), the new drive begins where the robot is and at its speed, as if that were a corner of a
planned path. Otherwise the robot brakes on its old path, which is free and its own up to there, and the new
path begins where it has come to rest: a sharp turn costs the time to brake and to speed up again, a reversal
also the way back. Its gaze turns meanwhile, at its rate.

Where something ends the new drive before the braking distance, the robot comes to rest on the path that it
was on, and the drive ends there.
"""

from __future__ import annotations

import math

from entropy_explore_env.belief.raycast import distance_between, point
from entropy_explore_env.compilation.kernels import lean_kernel, record_type
from entropy_explore_env.missions.action import decode_action
from entropy_explore_env.missions.localization import believed_pose
from entropy_explore_env.missions.poses import (
    copy_numbers,
    place_with_left,
    pose_at,
    share_left,
    speed_at,
)
from entropy_explore_env.missions.records import WAYPOINTS
from entropy_explore_env.robots.localization import believed_point

CHOICE = record_type(
    [
        ("pose", "f8", (5,)),  # where the robot is
        ("start", "f8", (3,)),  # where the path that it chose begins: there, or where it has come to rest
        ("viewpoint", "f8", (5,)),  # that it chose
        ("changed", "?"),  # whether its drive begins anew
        ("brakes", "?"),  # whether it first comes to rest
        ("path", "f8", (WAYPOINTS, 3)),  # points to which it will drive straight, one after the other
        (
            "waypoints",
            "i8",
        ),  # how many there are; 0 = straight to the viewpoint, which is the first of `path`
        ("path_end", "i8"),  # code of a MoveEnd: how the drive ends if nothing stops it
    ],
)
"""What a robot has chosen in a step, until it departs. Scratch memory: nothing in it is state."""

SAME_EDGES = 1e-3
"""A place that is nearer to the one before than this, in voxel edges along each axis, is the same."""
SAME_RAD = 1e-3
"""Yaw and pitch that differ by less are the same."""
_SHARPEST = math.cos(math.pi / 4) - 1e-6
"""Cosine of 45°, and the rounding of float32 actions."""
_STANDS_M = 1e-9
"""A robot with a shorter braking distance stands."""


@lean_kernel
def decide(params, actions, robot, estimate, time_s, continuous, discrete, choice, braking):
    """Write what a robot has chosen, as if it drove there straight, and whether that changes its drive."""
    copy_numbers(robot.goal, choice.pose, 5)
    if robot.under_way:
        copy_numbers(pose_at(params, robot, time_s), choice.pose, 5)
    copy_numbers(believed_pose(estimate, params, choice.pose), choice.pose, 5)
    decode_action(params, actions, choice.pose, continuous, discrete, choice.viewpoint)
    copy_numbers(choice.pose, choice.start, 3)
    copy_numbers(choice.viewpoint, choice.path[0], 3)
    choice.waypoints, choice.path_end, choice.brakes, choice.changed = 0, 0, False, True
    if braking is None:  # known while compiling: nothing of the rest is compiled
        return
    if robot.under_way and not robot.path_blocked:
        choice.changed = not keeps_target(params, choice, robot.target)


@lean_kernel
def keeps_target(params, choice, target):
    """Return whether a robot chose the viewpoint that it has, within reach as `encode_viewpoint` pulls it."""
    axes = 2 if params.planar else 3
    pose, viewpoint = choice.pose, choice.viewpoint
    length = 0.0
    for axis in range(axes):
        length += (target[axis] - pose[axis]) ** 2
    length = math.sqrt(length)
    share = params.reach_m / length if length > params.reach_m else 1.0
    same = True
    for axis in range(axes):
        moved = viewpoint[axis] - pose[axis] - share * (target[axis] - pose[axis])
        same = same and abs(moved) < SAME_EDGES * params.voxel_size_m
    turn = abs(viewpoint[3] - target[3]) % (2.0 * math.pi)
    return same and min(turn, 2.0 * math.pi - turn) < SAME_RAD and abs(viewpoint[4] - target[4]) < SAME_RAD


@lean_kernel
def braking_metres(params, robot, time_s):
    """Return the metres on which a robot that drives can come to rest, v²/2a; 0 = it stands."""
    speed = speed_at(params, robot, time_s)
    braking_m = 0.5 * speed * speed / params.acceleration_m_s2
    return braking_m if braking_m > _STANDS_M else 0.0


@lean_kernel
def resting_place(params, robot, time_s, braking_m):
    """Return (x, y, z, corners) where a robot would come to rest on its present path; see `place_at`."""
    left = share_left(params, robot, time_s)
    if braking_m > 0.0:
        left -= braking_m / robot.path_m
    return place_with_left(robot, left)


@lean_kernel
def note_braking(params, robot, estimate, time_s, choice, braking):
    """Find out whether a robot under way has to come to rest before the path that it chose.

    Args:
        choice: CHOICE; `brakes` and `start` are filled in.
    """
    if braking is None:  # known while compiling: nothing of the rest is compiled
        return
    if not robot.under_way:
        return
    braking_m = braking_metres(params, robot, time_s)
    if braking_m > 0.0:
        x, y, z, _ = resting_place(params, robot, time_s, braking_m)
        x, y, z = believed_point(estimate, (x, y, z))
        if not keeps_speed(choice, (x, y, z), braking_m):
            choice.brakes = True
            copy_numbers((x, y, z), choice.start, 3)


@lean_kernel
def keeps_speed(choice, rest, braking_m):
    """Return whether a robot's new path, up to its braking distance, leads about where it is driving already.

    Args:
        choice: CHOICE, with its new path from `pose`.
        rest: (x, y, z), where it would come to rest on the path that it is on.
        braking_m: Its braking distance.
    """
    start = point(choice.pose)
    begin, left = start, braking_m * (1.0 + 1e-9)
    for number in range(max(choice.waypoints, 1)):
        end = point(choice.path[number])
        leg_m = distance_between(begin, end)
        if leg_m >= left:
            share, along, old, new = left / leg_m, 0.0, 0.0, 0.0
            for axis in range(3):
                ahead = begin[axis] + share * (end[axis] - begin[axis]) - start[axis]
                before = rest[axis] - start[axis]
                along += ahead * before
                old += before * before
                new += ahead * ahead
            return along >= _SHARPEST * math.sqrt(old * new)
        left -= leg_m
        begin = end
    return False
