"""Where robots are: poses under way, in metres and in grid units."""

from __future__ import annotations

import math

from entropy_explore_env.belief.raycast import distance_between, point
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.robots.motion import SpeedProfile, driven_share, speed_after, turning_time


@lean_kernel
def copy_numbers(source, target, count):
    """Copy the first `count` numbers; a loop compiles ten times as fast as an array assignment."""
    for i in range(count):
        target[i] = source[i]


@inlined_kernel
def to_grid_units(params, position):
    """Return (x, y, z) in grid units from (x, y, z) in metres, map frame."""
    low, edge = params.origin_m, params.voxel_size_m
    return (position[0] - low[0]) / edge, (position[1] - low[1]) / edge, (position[2] - low[2]) / edge


@inlined_kernel
def within_grid(params, position):
    """Return (x, y, z) in grid units of a place in the workspace, in metres, map frame.

    A place on the workspace's upper faces may be rounded past them, by most where the map's origin is far
    away. It is brought back: rays begin inside, and none has a negative length.
    """
    x, y, z = to_grid_units(params, position)
    most_x, most_y, most_z = grid_size(params)
    return min(max(x, 0.0), float(most_x)), min(max(y, 0.0), float(most_y)), min(max(z, 0.0), float(most_z))


@inlined_kernel
def grid_size(params):
    """Return (X, Y, Z) voxels of the workspace."""
    return params.size[0], params.size[1], params.size[2]


@inlined_kernel
def path_point(robot, number):
    """Return (x, y, z) of a point on a drive: 0 its origin, then its corners, then its goal."""
    if number > robot.corners:
        return point(robot.goal)
    if number > 0:
        return point(robot.path[number - 1])
    return point(robot.origin)


@inlined_kernel
def profile_of(params, robot):
    """Return the SpeedProfile of a robot's latest drive."""
    return SpeedProfile(robot.path_m, robot.lead_s, params.max_speed_m_s, params.acceleration_m_s2)


@lean_kernel
def share_left(params, robot, time_s):
    """Share of its path that a robot still has to drive at a time between its departure and its next one."""
    if time_s >= robot.ready_s - params.scan_time_s:
        return 0.0
    return 1.0 - driven_share(time_s - robot.depart_s, profile_of(params, robot))


@lean_kernel
def since_scan_m(params, robot, time_s):
    """Return the metres that a robot has driven since its latest scan, or since its start."""
    if robot.deciding and not robot.under_way:
        return 0.0
    scanned_m = robot.scans_under_way * params.scan_every_m if robot.scans_under_way > 0 else 0.0
    driven_m = (1.0 - share_left(params, robot, time_s)) * robot.path_m
    return max(robot.scan_lead_m + driven_m - scanned_m, 0.0)


@lean_kernel
def speed_at(params, robot, time_s):
    """Return the speed of a robot on its path, in m/s, at a time as in `pose_at`."""
    if time_s >= robot.ready_s - params.scan_time_s:
        return 0.0
    return speed_after(time_s - robot.depart_s, profile_of(params, robot))


@lean_kernel
def place_at(params, robot, time_s):
    """Return (x, y, z, corners): where a robot is at a time as in `pose_at`, and the corners it passed."""
    return place_with_left(robot, share_left(params, robot, time_s))


@lean_kernel
def place_with_left(robot, left):
    """Return (x, y, z, corners) where this share of a robot's path is left, and how many it has passed."""
    end, passed = path_point(robot, robot.corners + 1), robot.corners
    if left <= 0.0:
        return end[0], end[1], end[2], passed
    while True:  # from the end of the path, which is so met exactly; `left` is a share of the whole path
        begin = path_point(robot, passed)
        leg_m = distance_between(begin, end)
        if passed == 0 or left * robot.path_m <= leg_m:
            break
        left -= leg_m / robot.path_m
        end = begin
        passed -= 1
    left = min(left * (robot.path_m / leg_m), 1.0) if leg_m > 0.0 else 0.0
    return (
        end[0] - left * (end[0] - begin[0]),
        end[1] - left * (end[1] - begin[1]),
        end[2] - left * (end[2] - begin[2]),
        passed,
    )


@lean_kernel
def pose_at(params, robot, time_s):
    """Return the pose (x, y, z, yaw, pitch) of a robot at a time between its departure and its next one."""
    origin, goal = robot.origin, robot.goal
    x, y, z, _ = place_at(params, robot, time_s)
    yaw, pitch, elapsed_s = goal[3], goal[4], time_s - robot.depart_s
    turn_s = turning_time(origin[3], origin[4], goal[3], goal[4], params.turn_rate_rad_s)
    if elapsed_s < turn_s and time_s < robot.ready_s - params.scan_time_s:
        shortest = (goal[3] - origin[3] + math.pi) % (2.0 * math.pi) - math.pi
        most = elapsed_s * params.turn_rate_rad_s
        yaw = origin[3] + min(max(shortest, -most), most)
        pitch = origin[4] + min(max(goal[4] - origin[4], -most), most)
    return x, y, z, yaw, pitch


@lean_kernel
def note_driven(params, robots, time_s):
    """Carry the distances of a team's robots on to a time as in `pose_at`."""
    for index in range(len(robots)):
        own, robot = params[index], robots[index]
        robot.distance_m = robot.departed_m + (1.0 - share_left(own, robot, time_s)) * robot.path_m
