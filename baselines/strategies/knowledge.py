"""What strategies read off a RobotView for kernels: the belief, and what teammates announced to see."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE, cone_of
from entropy_explore_env.missions.view import RobotView, TeammateView
from entropy_explore_env.settings import Grid


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
