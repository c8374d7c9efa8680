"""Where robots with a navigator plan their paths: before a step, in a call of its own.

So planning is compiled only where a robot plans.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.localization import estimate_in
from entropy_explore_env.missions.poses import to_grid_units, within_grid
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.redecision import decide, note_braking
from entropy_explore_env.missions.rules import ActionSet
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.robots.navigator import plan_path

_RUNNING = MissionEnd.RUNNING.code
_ARRIVED = MoveEnd.ARRIVED.code


class Planning(NamedTuple):
    """What plans are made from: parts of Rules and MissionState, of E missions."""

    params: np.ndarray
    """(A,) PARAMS."""
    actions: ActionSet
    missions: np.ndarray
    """(E,) MISSION."""
    robots: np.ndarray
    """(E, A) ROBOT."""
    choices: np.ndarray
    """(E, A) CHOICE; those of robots that decide are filled in."""
    mean: np.ndarray
    """(E, A, V) float32."""
    precision: np.ndarray
    """(E, A, V) float32."""
    no_fly: np.ndarray
    """(E·N, V) bool, for the N bodies as in MissionState.collision: where a body would reach above
    the ceiling, which robots that plan know; (E·N, 0) = no mission has one."""
    estimates: np.ndarray | None
    """(E, A) ESTIMATE; None = all robots know where they are."""


@lean_kernel
def plan_missions(planning, navigator, kind, braking, continuous, discrete, first, last):
    """Plan the paths of the robots of one kind that decide, each through its own belief.

    Args:
        navigator: Working space for this kind, not shared with another thread.
    """
    for mission in range(first, last):
        clock = planning.missions[mission]
        if clock.end == _RUNNING:
            for index in range(planning.robots.shape[1]):
                robot, own = planning.robots[mission, index], planning.params[index]
                if robot.deciding and own.kind == kind:
                    choice = planning.choices[mission, index]
                    chosen, number = continuous[mission, index], discrete[mission, index]
                    estimate = estimate_in(planning.estimates, mission, index)
                    time_s, actions = clock.time_s, planning.actions
                    decide(own, actions, robot, estimate, time_s, chosen, number, choice, braking)
                    mean, precision = planning.mean[mission, index], planning.precision[mission, index]
                    no_fly = planning.no_fly[mission * own.bodies + own.body_number]
                    if choice.changed:
                        plan_drive(own, navigator, mean, precision, no_fly, choice)
                        note_braking(own, robot, estimate, time_s, choice, braking)
                        if choice.brakes:
                            plan_drive(own, navigator, mean, precision, no_fly, choice)


@lean_kernel
def plan_drive(params, navigator, mean, precision, no_fly, choice):
    """Write a robot's path to its viewpoint: waypoints in metres, and how it ends if nothing stops it."""
    start, goal = within_grid(params, choice.start), to_grid_units(params, choice.viewpoint)
    path, origin = choice.path, params.origin_m
    choice.waypoints, choice.path_end = plan_path(navigator, mean, precision, no_fly, start, goal, path)
    for number in range(choice.waypoints):
        for axis in range(3):
            path[number, axis] = origin[axis] + path[number, axis] * params.voxel_size_m
    if choice.path_end == _ARRIVED:  # not up to rounding
        for axis in range(3):
            path[choice.waypoints - 1, axis] = choice.viewpoint[axis]
