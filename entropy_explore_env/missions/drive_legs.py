"""One straight leg of a drive: how far a body gets on it before an obstacle or a teammate stops it.

Map frame, metres, seconds; collision masks and bodies are met in grid units (see `motion`).
"""

from __future__ import annotations

from entropy_explore_env.belief.raycast import Line
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.poses import (
    distance_between,
    grid_size,
    path_point,
    place_at,
    to_grid_units,
    within_grid,
)
from entropy_explore_env.robots.motion import MoveEnd, distance_to_teammate, free_distance

_ARRIVED, _TEAMMATE = MoveEnd.ARRIVED.code, MoveEnd.TEAMMATE.code


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
