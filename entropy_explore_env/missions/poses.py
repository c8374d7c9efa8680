"""Where robots are: poses under way, in metres and in grid units."""

from __future__ import annotations

import math

from entropy_explore_env.compilation import lean_kernel
from entropy_explore_env.robots.motion import driven_share, turning_time


@lean_kernel
def copy_numbers(source, target, count):
    """Copy the first `count` numbers; a loop compiles ten times as fast as an array assignment."""
    for i in range(count):
        target[i] = source[i]


@lean_kernel
def grid_position(numbers, pose):
    """(x, y, z) in grid units; a tuple, which costs no memory."""
    low, edge = numbers.origin_m, numbers.voxel_size_m
    return (pose[0] - low[0]) / edge, (pose[1] - low[1]) / edge, (pose[2] - low[2]) / edge


@lean_kernel
def pose_at(numbers, robot, time_s):
    """Pose (x, y, z, yaw, pitch) of a robot at a time between its departure and its next one."""
    origin, goal = robot.origin, robot.goal
    elapsed = time_s - robot.depart_s
    if time_s >= robot.ready_s - numbers.scan_time_s:
        return goal[0], goal[1], goal[2], goal[3], goal[4]
    length = math.sqrt((goal[0] - origin[0]) ** 2 + (goal[1] - origin[1]) ** 2 + (goal[2] - origin[2]) ** 2)
    share = driven_share(elapsed, length, numbers.max_speed_m_s, numbers.acceleration_m_s2)
    left = 1.0 - share  # exactly the goal in the end
    x, y, z = (
        goal[0] - left * (goal[0] - origin[0]),
        goal[1] - left * (goal[1] - origin[1]),
        goal[2] - left * (goal[2] - origin[2]),
    )
    yaw, pitch = goal[3], goal[4]
    turn = turning_time(origin[3], origin[4], goal[3], goal[4], numbers.turn_rate_rad_s)
    if elapsed < turn:
        short_way = (goal[3] - origin[3] + math.pi) % (2.0 * math.pi) - math.pi
        most = elapsed * numbers.turn_rate_rad_s
        yaw = origin[3] + min(max(short_way, -most), most)
        pitch = origin[4] + min(max(goal[4] - origin[4], -most), most)
    return x, y, z, yaw, pitch
