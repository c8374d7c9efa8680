"""Where robots are: poses under way, in metres and in grid units."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.compilation import kernel
from entropy_explore_env.robots.motion import driven_share, turning_time


@kernel
def copy_numbers(source, target, count):
    """Copy the first `count` numbers; a loop compiles ten times as fast as an array assignment."""
    for i in range(count):
        target[i] = source[i]


@kernel
def grid_position(numbers, pose):
    """(3,) float64 position in grid units."""
    position = np.empty(3)
    for axis in range(3):
        position[axis] = (pose[axis] - numbers.origin_m[axis]) / numbers.voxel_size_m
    return position


@kernel
def pose_at(numbers, robot, time_s):
    """(5,) float64 pose of a robot at a time between its departure and its next one."""
    origin, goal = robot.origin, robot.goal
    elapsed = time_s - robot.depart_s
    pose = np.empty(5)
    copy_numbers(goal, pose, 5)
    if time_s >= robot.ready_s - numbers.scan_time_s:
        return pose
    length = math.sqrt((goal[0] - origin[0]) ** 2 + (goal[1] - origin[1]) ** 2 + (goal[2] - origin[2]) ** 2)
    share = driven_share(elapsed, length, numbers.max_speed_m_s, numbers.acceleration_m_s2)
    if share < 1.0:
        for axis in range(3):
            pose[axis] = origin[axis] + share * (goal[axis] - origin[axis])
    turn = turning_time(origin[3], origin[4], goal[3], goal[4], numbers.turn_rate_rad_s)
    if elapsed < turn:
        short_way = (goal[3] - origin[3] + math.pi) % (2.0 * math.pi) - math.pi
        most = elapsed * numbers.turn_rate_rad_s
        pose[3] = origin[3] + min(max(short_way, -most), most)
        pose[4] = origin[4] + min(max(goal[4] - origin[4], -most), most)
    return pose
