"""Path planning for the robots that have a navigator: before a step, in a call of its own.

So planning is compiled only for missions in which robots plan.
"""

from __future__ import annotations

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.action import decode_action
from entropy_explore_env.missions.poses import grid_position
from entropy_explore_env.missions.state import MissionEnd
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.robots.navigator import plan_path

_RUNNING = MissionEnd.RUNNING.code
_ARRIVED = MoveEnd.ARRIVED.code


@lean_kernel
def plan_missions(rules, state, closed, navigator, kind, boxes, numbers, first, last):
    """Plan the paths of the robots of one kind that decide, each through its own belief.

    Args:
        rules: The scenario.
        state: The MissionState of E missions; targets and ways are filled in.
        closed: (E·N, V) bool, for the N radii of bodies as in `blocked`, where one would reach above the
            ceiling, which those who plan know; (E·N, 0) = no mission has one.
        navigator: Working space for this kind, not shared with another thread.
        kind: Its number.
        boxes: (E, A, N) float64 continuous actions.
        numbers: (E, A) int64 discrete actions.
        first: The first mission.
        last: One past the last.
    """
    for mission in range(first, last):
        if state.missions[mission].end == _RUNNING:
            for index in range(state.robots.shape[1]):
                robot = state.robots[mission, index]
                own = rules.numbers[index]
                if robot.deciding and own.kind == kind:
                    box, number = boxes[mission, index], numbers[mission, index]
                    decode_action(rules, index, robot.goal, box, number, robot.target)
                    mean, precision = state.mean[mission, index], state.precision[mission, index]
                    there = closed[mission * own.radii + own.barriers]
                    plan_drive(own, navigator, mean, precision, there, robot)


@lean_kernel
def plan_drive(numbers, navigator, mean, precision, no_fly, robot):
    """Write a robot's path to its target: waypoints in metres, and how its drive ends if nothing stops it."""
    start, goal = grid_position(numbers, robot.goal), grid_position(numbers, robot.target)
    robot.waypoints, robot.way_end = plan_path(navigator, mean, precision, no_fly, start, goal, robot.way)
    for point in range(robot.waypoints):
        for axis in range(3):
            robot.way[point, axis] = numbers.origin_m[axis] + robot.way[point, axis] * numbers.voxel_size_m
    if robot.way_end == _ARRIVED:  # not up to rounding
        for axis in range(3):
            robot.way[robot.waypoints - 1, axis] = robot.target[axis]
