"""Drives of a team's robots: how far each gets on its way, when it scans, what ends it early.

Map frame, metres, seconds; barriers and bodies are met in grid units (see `motion`).
"""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.poses import (
    copy_numbers,
    distance_between,
    grid_position,
    place_at,
    way_point,
)
from entropy_explore_env.robots.motion import (
    MoveEnd,
    driving_time,
    free_way,
    line_believed_blocked,
    time_of_way,
    turning_time,
    way_to_teammate,
)

_ARRIVED, _TEAMMATE = MoveEnd.ARRIVED.code, MoveEnd.TEAMMATE.code
_CORNERS, _SEEN = MoveEnd.CORNERS.code, MoveEnd.SEEN.code
_ROUNDING = 1e-6
"""Of float32 actions, as a share: a scan under way so near to the end of the way is left to the arrival."""


@lean_kernel
def depart(team, blocked, robots, index, time_s, scan):
    """Commit a robot to its target: how far it will get, why no farther, and when it has scanned.

    Args:
        team: (A,) NUMBERS.
        blocked: (V,) float32, a Collision each, for its body.
        robots: (A,) ROBOT.
        index: Which robot.
        time_s: When it departs.
        scan: Working space.
    """
    numbers, robot = team[index], robots[index]
    origin, goal = robot.origin, robot.goal
    copy_numbers(goal, origin, 5)
    copy_numbers(robot.target, goal, 5)
    robot.depart_s = time_s
    robot.deciding = False
    robot.waiting = False
    robot.way_m = 0.0
    way, code = 0.0, _ARRIVED
    for leg in range(max(robot.waypoints, 1)):
        robot.corners = leg
        if robot.waypoints > 0:
            for axis in range(3):
                goal[axis] = robot.way[leg, axis]
        driven, code = drive_leg(team, blocked, robots, index, time_s, scan)
        way += driven
        robot.way_m += distance_between(way_point(robot, leg), way_point(robot, leg + 1))
        if code != _ARRIVED:
            break
    if code == _ARRIVED and robot.waypoints > 0:
        code = robot.way_end
    if code != _ARRIVED and code != _CORNERS:
        robot.blocked_moves += 1
    robot.move_end = code
    way_m = way * numbers.voxel_size_m
    robot.distance_m += way_m
    drive_s = driving_time(way_m, numbers.max_speed_m_s, numbers.acceleration_m_s2)
    turn_s = turning_time(origin[3], origin[4], goal[3], goal[4], numbers.turn_rate_rad_s)
    robot.ready_s = time_s + max(drive_s, turn_s) + numbers.scan_time_s
    robot.way_scans = 0
    plan_scan(numbers, robot)


@lean_kernel
def stop(numbers, robot, time_s):
    """After the scan where its drive ended a robot decides anew; behind a teammate it may wait before."""
    robot.waiting = numbers.blocked_wait_s > 0.0 and robot.move_end == _TEAMMATE
    robot.deciding = not robot.waiting
    robot.ready_s = time_s + numbers.blocked_wait_s if robot.waiting else time_s
    robot.next_scan_s = robot.ready_s


@lean_kernel
def next_decision(team, robots):
    """When the next robot decides: now, after the scan where its drive ends, or when it has waited.

    A drive that something under way may still end is taken to end where it was meant to.
    """
    soonest = math.inf
    for index in range(len(robots)):
        robot = robots[index]
        waits = robot.move_end == _TEAMMATE and not robot.waiting
        soonest = min(soonest, robot.ready_s + (team[index].blocked_wait_s if waits else 0.0))
    return soonest


@lean_kernel
def drive_leg(team, blocked, robots, index, time_s, scan):
    """Drive from a robot's last corner straight to its goal, drawn nearer if something is in the way.

    Returns:
        (way, code): the way in grid units, and the code of a MoveEnd.
    """
    numbers = team[index]
    goal, begin = robots[index].goal, way_point(robots[index], robots[index].corners)
    start, finish = grid_position(numbers, begin), grid_position(numbers, goal)
    length = distance_between(start, finish)
    if length <= 0.0:
        return 0.0, _ARRIVED
    direction = (
        (finish[0] - start[0]) / length,
        (finish[1] - start[1]) / length,
        (finish[2] - start[2]) / length,
    )
    size = (numbers.size[0], numbers.size[1], numbers.size[2])
    way, code = free_way(blocked, size, start, finish, direction, length, scan.way, scan.way_entered)
    for mate in range(len(robots)):
        if mate != index and team[mate].body_radius_m > 0.0:
            touching = (numbers.body_radius_m + team[mate].body_radius_m) / numbers.voxel_size_m
            clear = way_to_tube(team[mate], touching, start, direction, way, robots[mate], time_s)
            if clear < way:
                way, code = clear, _TEAMMATE
    if code != _ARRIVED:
        for axis in range(3):
            goal[axis] = begin[axis] + direction[axis] * way * numbers.voxel_size_m
    return way, code


@lean_kernel
def way_to_tube(numbers, touching, start, direction, way, mate, time_s):
    """How far a body can drive on a line, at most `way`, before the tube that a teammate still sweeps.

    Args:
        numbers: NUMBERS of the teammate.
        touching: Sum of the two radii in grid units.
        start: (x, y, z), where the line begins, in grid units.
        direction: (x, y, z), its unit vector.
        way: In grid units.
        mate: ROBOT of the teammate.
        time_s: When the body departs.
    """
    x, y, z, passed = place_at(numbers, mate, time_s)
    begin = grid_position(numbers, (x, y, z))
    for point in range(passed, mate.corners + 1):
        stop = grid_position(numbers, way_point(mate, point + 1))
        way = way_to_teammate(start, direction, way, begin, stop, touching)
        begin = stop
    return way


@lean_kernel
def plan_scan(numbers, robot):
    """Set when a robot scans next: after so many metres of its way, or where the drive ends."""
    robot.next_scan_s = robot.ready_s
    scan_m = (robot.way_scans + 1) * numbers.scan_every_m
    if scan_m < robot.way_m * (1.0 - _ROUNDING):
        driving_s = time_of_way(scan_m, robot.way_m, numbers.max_speed_m_s, numbers.acceleration_m_s2)
        robot.next_scan_s = robot.depart_s + driving_s


@lean_kernel
def drive_on(numbers, balls, mean, robot, time_s, scan):
    """After a scan under way: end the drive if the rest of its planned way is believed blocked.

    Args:
        numbers: NUMBERS.
        balls: (K, B, 3) int64, what bodies of each kind touch; None where nobody plans: then nothing
            here is compiled but the next scan.
        mean: (V,) float32, the robot's expected coverage.
        robot: Its ROBOT.
        time_s: When it scanned.
        scan: Working space.
    """
    robot.way_scans += 1
    plan_scan(numbers, robot)
    if balls is not None:
        passed = place_at(numbers, robot, time_s)[3]
        if rest_blocked(numbers, balls[numbers.kind], mean, robot, passed, scan):
            end_drive(numbers, robot, passed, time_s)


@lean_kernel
def end_drive(numbers, robot, passed, time_s):
    """Let a drive end where the robot has just scanned, behind so many corners; it decides anew."""
    driven_m = robot.way_scans * numbers.scan_every_m
    robot.distance_m -= robot.way_m - driven_m
    copy_numbers(robot.scan_pose, robot.goal, 5)
    robot.corners, robot.way_m = passed, driven_m
    robot.ready_s, robot.next_scan_s, robot.deciding = time_s, time_s, True
    if robot.move_end == _ARRIVED or robot.move_end == _CORNERS:
        robot.blocked_moves += 1
    robot.move_end = _SEEN


@lean_kernel
def rest_blocked(numbers, ball, mean, robot, passed, scan):
    """Whether something is believed in the way from where a robot scanned to the end of its planned way."""
    size = (numbers.size[0], numbers.size[1], numbers.size[2])
    radius, start = numbers.body_radius_m / numbers.voxel_size_m, grid_position(numbers, robot.scan_pose)
    for point in range(passed, robot.waypoints):
        to = robot.way[point, 0], robot.way[point, 1], robot.way[point, 2]
        finish = grid_position(numbers, to)
        if line_believed_blocked(mean, size, ball, radius, start, finish, scan.way, scan.way_entered):
            return True
        start = finish
    return False
