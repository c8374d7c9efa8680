"""What strategies read off a RobotView: the belief, for kernels, and what is known of teammates."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE, cone_of
from entropy_explore_env.missions.view import RobotView, TeammateView
from entropy_explore_env.robots.motion import driving_time
from entropy_explore_env.settings import Grid

_LOST_AFTER = 2.0
"""A silent robot counts as under way for this many times a drive along all sides of the workspace."""


def belief_of(view: RobotView) -> Belief:
    """The belief of a view's robot."""
    return Belief(view.mean.reshape(-1), view.precision.reshape(-1), view.scenario.grid.shape)


def voxel_of(view: RobotView, pose: np.ndarray) -> int:
    """Number of the voxel of a pose (3,) or (5,), map frame; the nearest one for poses outside."""
    grid = view.scenario.grid
    indices = np.clip(grid.voxel_of(pose[:3]), 0, np.array(grid.shape) - 1)
    return int(np.ravel_multi_index(tuple(indices), grid.shape))


def teammates_that_share(view: RobotView) -> Mapping[int, TeammateView]:
    """Teammates whose scans may reach the robot: no silent ones, and none where the channel carries no scans.

    What the others go to see it has to see itself: nothing is left to them.
    """
    if view.scenario.channel.burst == 0:
        return {}
    return {mate: seen for mate, seen in view.teammates.items() if not seen.silent}


def under_way(view: RobotView, mate: TeammateView, robot: int) -> bool:
    """Whether a teammate, by what was heard of it, is on its way to the viewpoint that it announced.

    It is until a scan from there is heard, or until so much time has passed that it must have arrived: then
    it is out of the channel's range, or its messages were lost. Scans that are taken during a drive do not
    count.
    """
    if mate.announced_s < 0.0:
        return False
    kind, size_m = view.scenario.kind_of(robot), view.scenario.grid.size_m
    if mate.heard_s <= mate.announced_s:
        drive_s = driving_time(float(sum(size_m)), kind.robot.max_speed_m_s, kind.robot.acceleration_m_s2)
        return view.time_s - mate.announced_s <= _LOST_AFTER * drive_s + kind.sensor.scan_time_s
    if math.isinf(kind.sensor.scan_every_m):
        return False
    apart_m = float(np.linalg.norm(mate.pose[:3] - mate.viewpoint[:3]))
    return apart_m > view.scenario.grid.voxel_size_m


def stays(view: RobotView, mate: TeammateView) -> bool:
    """Whether a teammate waits: the viewpoint that it announced is where it was before."""
    apart_m = float(np.linalg.norm(mate.pose[:3] - mate.viewpoint[:3]))
    return apart_m < 0.5 * view.scenario.grid.voxel_size_m


def announced_cone(grid: Grid, mate: TeammateView) -> np.void:
    """The CONE that a teammate announced, in grid units: V(Yˢ, r̂, α̂) (RochaMI)."""
    cones = np.zeros(1, CONE)
    depth = mate.depth_m / grid.voxel_size_m
    cones[0] = cone_of(grid.in_grid_units(mate.viewpoint), depth, mate.half_angle_rad)
    return cones[0]


def announced_cones(view: RobotView) -> np.ndarray:
    """(M,) CONE of what teammates have announced to see, in grid units."""
    heard = [mate for mate in view.teammates.values() if mate.announced_s >= 0.0 and mate.depth_m > 0.0]
    cones = np.zeros(len(heard), CONE)
    for place, mate in enumerate(heard):
        cones[place] = announced_cone(view.scenario.grid, mate)
    return cones
