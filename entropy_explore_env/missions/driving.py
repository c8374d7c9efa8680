"""Drives of a team's robots: how far each gets on its path, when it scans, what ends the drive early.

Map frame, metres, seconds; collision masks and bodies are met in grid units (see `motion`).
"""

from __future__ import annotations

import math

from entropy_explore_env.belief.raycast import Line, distance_between, point
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.localization import (
    believed_pose,
    choice_into_world,
    estimate_of,
    into_workspace,
)
from entropy_explore_env.missions.poses import (
    copy_numbers,
    grid_size,
    path_point,
    place_at,
    pose_at,
    profile_of,
    share_left,
    since_scan_m,
    to_grid_units,
    within_grid,
)
from entropy_explore_env.missions.redecision import braking_metres, resting_place
from entropy_explore_env.robots.localization import believed_point
from entropy_explore_env.robots.motion import (
    MoveEnd,
    SpeedProfile,
    distance_to_teammate,
    duration_of,
    free_distance,
    line_believed_blocked,
    time_after,
    turning_time,
)

_ARRIVED, _TEAMMATE = MoveEnd.ARRIVED.code, MoveEnd.TEAMMATE.code
_CORNERS, _SEEN, _FAILED = MoveEnd.CORNERS.code, MoveEnd.SEEN.code, MoveEnd.FAILED.code
_ROUNDING = 1e-6
"""Of float32 actions, as a share: a scan this near to the end of the path is left to the arrival."""


@lean_kernel
def start_drive(team, collision, choice, index, time_s, work):
    """Commit a robot to what it chose: how far it will get, why no farther, and when it has scanned.

    Args:
        collision: (V,) float32, a Collision each, for its body.
        choice: CHOICE of the robot, as it means it; turned into the world where that differs.
    """
    params, robots = team.params, team.robots
    own, robot, goal = params[index], robots[index], robots[index].goal
    choice_into_world(estimate_of(team.localization, index), own, robot, choice, time_s)
    rests = leave_path(own, robot, time_s, work.braking)
    free = take_path(robot, choice, rests, work.braking)
    robot.depart_s = robot.decided_s = time_s
    robot.deciding = robot.waiting = robot.under_way = robot.path_blocked = False
    driven, code = 0.0, _ARRIVED
    for leg in range(max(robot.waypoints, 1)):
        robot.corners = leg
        if robot.waypoints > 0:
            for axis in range(3):
                goal[axis] = robot.path[leg, axis]
        if leg < free:
            distance = distance_between(path_point(robot, leg), path_point(robot, leg + 1)) / own.voxel_size_m
        else:
            distance, code = drive_leg(params, collision, robots, index, time_s, work.drive)
        driven += distance
        robot.path_m += distance_between(path_point(robot, leg), path_point(robot, leg + 1))
        if code != _ARRIVED:
            break
    if code == _ARRIVED and robot.waypoints > 0:
        code = robot.path_end
    driven_m = driven * own.voxel_size_m
    if rest_on_path(own, robot, rests, work.braking):
        driven_m = robot.path_m
    robot.move_end = code
    drive_s = duration_of(SpeedProfile(driven_m, robot.lead_s, own.max_speed_m_s, own.acceleration_m_s2))
    turn_s = turning_time(robot.origin[3], robot.origin[4], goal[3], goal[4], own.turn_rate_rad_s)
    robot.ready_s = time_s + max(drive_s, turn_s) + own.scan_time_s
    robot.scans_under_way = 0
    plan_scan(own, robot)
    plan_redecision(own, robot, time_s, work.braking)


@lean_kernel
def drive_leg(params, collision, robots, index, time_s, crossing):
    """Drive from a robot's last corner straight to its goal, drawn nearer if something is in the way.

    Args:
        collision: (V,) float32, a Collision each, for its body.

    Returns:
        (distance, code): driven in grid units, and the code of a MoveEnd.
    """
    own = params[index]
    goal, begin = robots[index].goal, path_point(robots[index], robots[index].corners)
    start, finish = within_grid(own, begin), to_grid_units(own, goal)
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
    """Return how much of a distance, in grid units, a body can drive on a line before a teammate's tube.

    `mate` still sweeps the tube; `touching` is the sum of the two radii in grid units.
    """
    x, y, z, passed = place_at(params, mate, time_s)
    begin = to_grid_units(params, (x, y, z))
    for number in range(passed, mate.corners + 1):
        end = to_grid_units(params, path_point(mate, number + 1))
        distance = distance_to_teammate(line.start, line.direction, distance, begin, end, touching)
        begin = end
    return distance


@lean_kernel
def leave_path(params, robot, time_s, braking):
    """Give up the rest of a robot's drive, if it is under way, and note how it can come to rest on it.

    Args:
        robot: ROBOT; its speed is noted.
        braking: (W, 3) float64, filled in; see Workspace.

    Returns:
        How many points there are in `braking`: to them it drives straight, one after the other, at the last
        of them it is at rest. 0 = it stands already.
    """
    if braking is None:  # known while compiling: nothing of the rest is compiled
        return 0
    if not robot.under_way:
        robot.lead_s = robot.scan_lead_m = 0.0
        return 0
    braking_m = braking_metres(params, robot, time_s)
    if not math.isinf(params.scan_every_m):
        robot.scan_lead_m = min(since_scan_m(params, robot, time_s), params.scan_every_m)
    behind = place_at(params, robot, time_s)[3]
    x, y, z, passed = resting_place(params, robot, time_s, braking_m)
    robot.lead_s = math.sqrt(2.0 * braking_m / params.acceleration_m_s2)
    if braking_m == 0.0:
        return 0
    for number in range(behind, passed):
        copy_numbers(robot.path[number], braking[number - behind], 3)
    copy_numbers((x, y, z), braking[passed - behind], 3)
    return passed - behind + 1


@lean_kernel
def take_path(robot, choice, rests, braking):
    """Put a robot on the path that it chose, behind the `rests` points of `braking` if it brakes first.

    Returns:
        How many legs of the path are known to be free.
    """
    robot.path_m, robot.departed_m = 0.0, robot.distance_m
    copy_numbers(choice.pose, robot.origin, 5)
    copy_numbers(choice.viewpoint, robot.goal, 5)
    if choice.brakes:
        return brake_first(robot, choice, rests, braking)
    robot.waypoints, robot.path_end = choice.waypoints, choice.path_end
    for number in range(choice.waypoints):
        copy_numbers(choice.path[number], robot.path[number], 3)
    return 0


@lean_kernel
def brake_first(robot, choice, rests, braking):
    """Put a robot on the `rests` points of `braking`, and then on the path that it chose; see `take_path`."""
    if braking is None:  # known while compiling: nothing of the rest is compiled
        return 0
    robot.lead_s = -robot.lead_s
    for number in range(rests):
        copy_numbers(braking[number], robot.path[number], 3)
    points = max(choice.waypoints, 1)
    kept = min(points, len(robot.path) - rests)
    for number in range(kept):
        copy_numbers(choice.path[number], robot.path[rests + number], 3)
    robot.waypoints = rests + kept
    robot.path_end = choice.path_end if kept == points else _CORNERS
    return rests


@lean_kernel
def rest_on_path(params, robot, rests, braking):
    """Let a drive that is too short to come to rest on end where its robot comes to rest on its old path.

    That is behind the first `rests` points of `braking`. Returns whether the drive was too short.
    """
    if braking is None:  # known while compiling: nothing of the rest is compiled
        return False
    if robot.lead_s <= 0.0 or robot.path_m >= 0.5 * params.acceleration_m_s2 * robot.lead_s * robot.lead_s:
        return False
    for number in range(rests):
        copy_numbers(braking[number], robot.path[number], 3)
    copy_numbers(braking[rests - 1], robot.goal, 3)
    robot.waypoints, robot.corners, robot.path_m, robot.lead_s = rests, rests - 1, 0.0, -robot.lead_s
    for leg in range(rests):
        robot.path_m += distance_between(path_point(robot, leg), path_point(robot, leg + 1))
    return True


@lean_kernel
def keep_drive(params, robot, time_s, braking):
    """Let a robot that keeps its viewpoint drive on as it does."""
    robot.deciding = robot.under_way = False
    robot.decided_s = time_s
    plan_redecision(params, robot, time_s, braking)


@lean_kernel
def plan_redecision(params, robot, time_s, braking):
    """Set when a robot that has just decided does so again under way; inf where it stops before that."""
    robot.redecide_s = math.inf
    if braking is None:  # known while compiling: nothing of the rest is compiled
        return
    if params.redecide_on_scan and robot.next_scan_s < robot.ready_s:
        robot.redecide_s = robot.next_scan_s
    elif not math.isinf(params.redecide_every_s):
        due_s = time_s + params.redecide_every_s
        if time_s < due_s < robot.depart_s + duration_of(profile_of(params, robot)):
            robot.redecide_s = due_s


@lean_kernel
def redecide(robot, time_s):
    """Let a robot decide under way, where it has driven since it last decided."""
    if time_s > robot.decided_s:
        robot.deciding = robot.under_way = True
        robot.redecide_s = time_s
    else:
        robot.redecide_s = math.inf


@lean_kernel
def stop(params, robot, time_s):
    """Let a robot decide after the scan where its drive ended; behind a teammate it may wait first."""
    if ends_blocked(robot):
        robot.blocked_moves += 1
    robot.waiting = params.blocked_wait_s > 0.0 and robot.move_end == _TEAMMATE
    robot.deciding = not robot.waiting
    robot.ready_s = time_s + params.blocked_wait_s if robot.waiting else time_s
    robot.next_scan_s = robot.ready_s
    robot.under_way = robot.path_blocked = False
    robot.redecide_s = math.inf


@lean_kernel
def ends_blocked(robot):
    """Return whether a robot's drive ends short of the end of its path."""
    return robot.move_end != _ARRIVED and robot.move_end != _CORNERS


@lean_kernel
def halt(params, robot, time_s, until_s):
    """Stop a robot at once where it is; its drive and its scan are over, and it decides anew at a time.

    Args:
        until_s: When it decides; inf = never.
    """
    here = pose_at(params, robot, time_s)
    scanning = not robot.deciding and not robot.waiting
    if share_left(params, robot, time_s) > 0.0 or (scanning and ends_blocked(robot)):
        robot.blocked_moves += 1
    copy_numbers(here, robot.origin, 5)
    copy_numbers(here, robot.goal, 5)
    robot.waypoints = robot.corners = robot.scans_under_way = 0
    robot.path_m = robot.lead_s = robot.scan_lead_m = 0.0
    robot.departed_m = robot.distance_m
    robot.depart_s, robot.move_end = time_s, _FAILED
    robot.deciding = robot.under_way = robot.path_blocked = False
    robot.waiting = True
    robot.ready_s = robot.next_scan_s = until_s
    robot.redecide_s = math.inf


@lean_kernel
def next_decision(params, robots):
    """Return when the next robot decides: now, under way, after its drive's last scan, or after a wait.

    A drive that something under way may still end is taken to end where it was meant to.
    """
    soonest = math.inf
    for index in range(len(robots)):
        robot = robots[index]
        waits = robot.move_end == _TEAMMATE and not robot.waiting
        stops_s = robot.ready_s + (params[index].blocked_wait_s if waits else 0.0)
        soonest = min(soonest, stops_s, robot.redecide_s)
    return soonest


@lean_kernel
def plan_scan(params, robot):
    """Set when a robot scans next: after this many metres of its path, or where the drive ends."""
    robot.next_scan_s = robot.ready_s
    scan_m = (robot.scans_under_way + 1) * params.scan_every_m - robot.scan_lead_m
    if scan_m < robot.path_m * (1.0 - _ROUNDING):
        robot.next_scan_s = robot.depart_s + time_after(scan_m, profile_of(params, robot))


@lean_kernel
def continue_drive(params, footprint, mean, robot, estimate, time_s, crossing):
    """See, after a scan under way, whether the rest of a planned path is believed blocked.

    Then the drive ends, or a robot that decides under way does so now; some do so at every such scan.

    Args:
        footprint: (B, 3) int64, offsets of the voxels that its body touches.
    """
    robot.scans_under_way += 1
    plan_scan(params, robot)
    decides = params.redecide_on_scan
    if params.planned:
        passed = place_at(params, robot, time_s)[3]
        if rest_blocked(params, footprint, mean, robot, estimate, passed, crossing):
            if params.redecide_on_scan or not math.isinf(params.redecide_every_s):
                robot.path_blocked = decides = True
            else:
                end_drive(params, robot, passed, time_s)
    if decides:
        redecide(robot, time_s)


@lean_kernel
def end_drive(params, robot, passed, time_s):
    """Let a drive end where the robot has just scanned, after `passed` corners; it decides anew."""
    driven_m = robot.scans_under_way * params.scan_every_m
    copy_numbers(robot.scan_pose, robot.goal, 5)
    robot.corners, robot.path_m = passed, driven_m
    robot.ready_s, robot.next_scan_s, robot.deciding = time_s, time_s, True
    robot.blocked_moves += 1
    robot.move_end = _SEEN


@lean_kernel
def believed_corner(estimate, params, corner):
    """Return (x, y, z) of a path's corner, in the workspace, where a robot believes it to be."""
    x, y, z = believed_point(estimate, point(corner))
    if estimate is None:  # known while compiling: nothing of the rest is compiled
        return x, y, z
    return into_workspace(params, 0, x), into_workspace(params, 1, y), into_workspace(params, 2, z)


@lean_kernel
def rest_blocked(params, footprint, mean, robot, estimate, passed, crossing):
    """Return whether the rest of a planned path, from where the robot scanned, is believed blocked."""
    size, radius = grid_size(params), params.body_radius_m / params.voxel_size_m
    start = within_grid(params, believed_pose(estimate, params, robot.scan_pose))
    for number in range(passed, robot.waypoints):
        finish = to_grid_units(params, believed_corner(estimate, params, robot.path[number]))
        if line_believed_blocked(mean, size, footprint, radius, start, finish, crossing):
            return True
        start = finish
    return False
