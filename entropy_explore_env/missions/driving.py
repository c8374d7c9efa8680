"""Drives of a team's robots: how far each gets on its path, when it scans, what ends the drive early.

Map frame, metres, seconds; collision masks and bodies are met in grid units (see `motion`).
"""

from __future__ import annotations

import math

from entropy_explore_env.belief.raycast import Line, point
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.poses import (
    copy_numbers,
    distance_between,
    grid_size,
    path_point,
    place_at,
    to_grid_units,
)
from entropy_explore_env.robots.motion import (
    MoveEnd,
    distance_to_teammate,
    driving_time,
    free_distance,
    line_believed_blocked,
    time_after,
    turning_time,
)

_ARRIVED, _TEAMMATE = MoveEnd.ARRIVED.code, MoveEnd.TEAMMATE.code
_CORNERS, _SEEN = MoveEnd.CORNERS.code, MoveEnd.SEEN.code
_ROUNDING = 1e-6
"""Of float32 actions, as a share: a scan this near to the end of the path is left to the arrival."""


@lean_kernel
def start_drive(params, collision, robots, index, time_s, crossing):
    """Commit a robot to its target: how far it will get, why no farther, and when it has scanned.

    Args:
        params: (A,) PARAMS.
        collision: (V,) float32, a Collision each, for its body.
        robots: (A,) ROBOT.
        index: Which robot.
        time_s: When it departs.
        crossing: Crossing, scratch space.
    """
    own, robot = params[index], robots[index]
    origin, goal = robot.origin, robot.goal
    copy_numbers(goal, origin, 5)
    copy_numbers(robot.target, goal, 5)
    robot.depart_s = time_s
    robot.deciding = False
    robot.waiting = False
    robot.path_m = 0.0
    driven, code = 0.0, _ARRIVED
    for leg in range(max(robot.waypoints, 1)):
        robot.corners = leg
        if robot.waypoints > 0:
            for axis in range(3):
                goal[axis] = robot.path[leg, axis]
        distance, code = drive_leg(params, collision, robots, index, time_s, crossing)
        driven += distance
        robot.path_m += distance_between(path_point(robot, leg), path_point(robot, leg + 1))
        if code != _ARRIVED:
            break
    if code == _ARRIVED and robot.waypoints > 0:
        code = robot.path_end
    if code != _ARRIVED and code != _CORNERS:
        robot.blocked_moves += 1
    robot.move_end = code
    driven_m = driven * own.voxel_size_m
    robot.distance_m += driven_m
    drive_s = driving_time(driven_m, own.max_speed_m_s, own.acceleration_m_s2)
    turn_s = turning_time(origin[3], origin[4], goal[3], goal[4], own.turn_rate_rad_s)
    robot.ready_s = time_s + max(drive_s, turn_s) + own.scan_time_s
    robot.scans_under_way = 0
    plan_scan(own, robot)


@lean_kernel
def stop(params, robot, time_s):
    """After the scan where its drive ended a robot decides anew; behind a teammate it may wait before."""
    robot.waiting = params.blocked_wait_s > 0.0 and robot.move_end == _TEAMMATE
    robot.deciding = not robot.waiting
    robot.ready_s = time_s + params.blocked_wait_s if robot.waiting else time_s
    robot.next_scan_s = robot.ready_s


@lean_kernel
def next_decision(params, robots):
    """When the next robot decides: now, after the scan where its drive ends, or when it has waited.

    A drive that something under way may still end is taken to end where it was meant to.
    """
    soonest = math.inf
    for index in range(len(robots)):
        robot = robots[index]
        waits = robot.move_end == _TEAMMATE and not robot.waiting
        soonest = min(soonest, robot.ready_s + (params[index].blocked_wait_s if waits else 0.0))
    return soonest


@lean_kernel
def drive_leg(params, collision, robots, index, time_s, crossing):
    """Drive from a robot's last corner straight to its goal, drawn nearer if something is in the way.

    Args:
        params: (A,) PARAMS.
        collision: (V,) float32, a Collision each, for its body.
        robots: (A,) ROBOT.
        index: Which robot.
        time_s: When it departs.
        crossing: Crossing, scratch space.

    Returns:
        (distance, code): driven in grid units, and the code of a MoveEnd.
    """
    own = params[index]
    goal, begin = robots[index].goal, path_point(robots[index], robots[index].corners)
    start, finish = to_grid_units(own, begin), to_grid_units(own, goal)
    length = distance_between(start, finish)
    if length <= 0.0:
        return 0.0, _ARRIVED
    direction = (
        (finish[0] - start[0]) / length,
        (finish[1] - start[1]) / length,
        (finish[2] - start[2]) / length,
    )
    line = Line(start, direction, length)
    distance, code = free_distance(collision, grid_size(own), line, finish, crossing)
    for mate in range(len(robots)):
        if mate != index and params[mate].body_radius_m > 0.0:
            touching = (own.body_radius_m + params[mate].body_radius_m) / own.voxel_size_m
            clear = distance_to_tube(params[mate], robots[mate], time_s, line, distance, touching)
            if clear < distance:
                distance, code = clear, _TEAMMATE
    if code != _ARRIVED:
        for axis in range(3):
            goal[axis] = begin[axis] + direction[axis] * distance * own.voxel_size_m
    return distance, code


@lean_kernel
def distance_to_tube(params, mate, time_s, line, distance, touching):
    """How far a body can drive on a line before the tube that a teammate still sweeps.

    Args:
        params: PARAMS of the teammate.
        mate: ROBOT of the teammate.
        time_s: When the body departs.
        line: Line of the drive.
        distance: How far it wants to drive, in grid units.
        touching: Sum of the two radii in grid units.

    Returns:
        The distance in grid units, at most `distance`.
    """
    x, y, z, passed = place_at(params, mate, time_s)
    begin = to_grid_units(params, (x, y, z))
    for number in range(passed, mate.corners + 1):
        end = to_grid_units(params, path_point(mate, number + 1))
        distance = distance_to_teammate(line.start, line.direction, distance, begin, end, touching)
        begin = end
    return distance


@lean_kernel
def plan_scan(params, robot):
    """Set when a robot scans next: after so many metres of its path, or where the drive ends."""
    robot.next_scan_s = robot.ready_s
    scan_m = (robot.scans_under_way + 1) * params.scan_every_m
    if scan_m < robot.path_m * (1.0 - _ROUNDING):
        driving_s = time_after(scan_m, robot.path_m, params.max_speed_m_s, params.acceleration_m_s2)
        robot.next_scan_s = robot.depart_s + driving_s


@lean_kernel
def continue_drive(params, footprint, mean, robot, time_s, crossing):
    """After a scan under way: end the drive if the rest of its planned path is believed blocked.

    Args:
        params: PARAMS of the robot.
        footprint: (B, 3) int64, offsets of the voxels that its body touches.
        mean: (V,) float32, the robot's expected coverage.
        robot: Its ROBOT.
        time_s: When it scanned.
        crossing: Crossing, scratch space.
    """
    robot.scans_under_way += 1
    plan_scan(params, robot)
    if params.planned:
        passed = place_at(params, robot, time_s)[3]
        if rest_blocked(params, footprint, mean, robot, passed, crossing):
            end_drive(params, robot, passed, time_s)


@lean_kernel
def end_drive(params, robot, passed, time_s):
    """Let a drive end where the robot has just scanned, after `passed` corners; it decides anew."""
    driven_m = robot.scans_under_way * params.scan_every_m
    robot.distance_m -= robot.path_m - driven_m
    copy_numbers(robot.scan_pose, robot.goal, 5)
    robot.corners, robot.path_m = passed, driven_m
    robot.ready_s, robot.next_scan_s, robot.deciding = time_s, time_s, True
    if robot.move_end == _ARRIVED or robot.move_end == _CORNERS:
        robot.blocked_moves += 1
    robot.move_end = _SEEN


@lean_kernel
def rest_blocked(params, footprint, mean, robot, passed, crossing):
    """Whether the rest of a planned path, from where the robot scanned, is believed blocked."""
    size, radius = grid_size(params), params.body_radius_m / params.voxel_size_m
    start = to_grid_units(params, robot.scan_pose)
    for number in range(passed, robot.waypoints):
        finish = to_grid_units(params, point(robot.path[number]))
        if line_believed_blocked(mean, size, footprint, radius, start, finish, crossing):
            return True
        start = finish
    return False
