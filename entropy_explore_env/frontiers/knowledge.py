"""What rules read off what a robot knows: its belief, its voxel, what teammates do, a random viewpoint."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE, cone_of
from entropy_explore_env.robots.knowledge import RobotKnowledge, TeammateView
from entropy_explore_env.robots.motion import driving_time
from entropy_explore_env.settings.grid import Grid

_DRAWS = 64
"""Places that are drawn until one lies within reach."""
_LOST_AFTER = 2.0
"""A silent robot counts as under way for this many times a drive along all sides of the workspace."""


def belief_of(view: RobotKnowledge) -> Belief:
    """Return the belief of a view's robot."""
    return Belief(view.mean.reshape(-1), view.precision.reshape(-1), view.scenario.grid.shape)


def voxel_of(view: RobotKnowledge, pose: np.ndarray) -> int:
    """Return the number of the voxel of a pose (3,) or (5,), map frame; the nearest one for poses outside.

    If the view's robot stays in a layer, the voxel lies in that layer.
    """
    grid, kind = view.scenario.grid, view.scenario.kind_of(view.robot)
    layer = view.scenario.layer_of(kind.robot)
    indices = np.clip(grid.voxel_of(pose[:3]), 0, np.array(grid.shape) - 1)
    if layer is not None:
        indices[2] = layer
    return int(np.ravel_multi_index(tuple(indices), grid.shape))


def centres_of(view: RobotKnowledge, voxels: int | np.ndarray) -> np.ndarray:
    """Return the centres (..., 3) of (...) voxels, map frame; planar robots stay at their sensor's height."""
    grid = view.scenario.grid
    places = grid.centre_of(np.stack(np.unravel_index(voxels, grid.shape), axis=-1))
    if view.planar:
        places[..., 2] = view.pose[2]
    return places


def teammates_that_share(view: RobotKnowledge) -> Mapping[int, TeammateView]:
    """Return the teammates whose scans may reach the robot: none that is silent.

    Where the channel carries no scans there are none: what others see the robot has to see itself.
    """
    if view.scenario.channel.burst == 0:
        return {}
    return {mate: seen for mate, seen in view.teammates.items() if not seen.silent}


def under_way(view: RobotKnowledge, mate: TeammateView, robot: int) -> bool:
    """Return whether a teammate, by what was heard of it, is on its way to the viewpoint that it announced.

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


def stays(view: RobotKnowledge, mate: TeammateView) -> bool:
    """Return whether a teammate waits: the viewpoint that it announced is where it was before."""
    apart_m = float(np.linalg.norm(mate.pose[:3] - mate.viewpoint[:3]))
    return apart_m < 0.5 * view.scenario.grid.voxel_size_m


def announced_cone(grid: Grid, mate: TeammateView) -> np.void:
    """Return the CONE that a teammate announced, in grid units: V(Yˢ, r̂, α̂) (RochaMI)."""
    cones = np.zeros(1, CONE)
    depth = mate.depth_m / grid.voxel_size_m
    cones[0] = cone_of(grid.in_grid_units(mate.viewpoint), depth, mate.half_angle_rad)
    return cones[0]


def random_viewpoint(view: RobotKnowledge, rng: np.random.Generator) -> np.ndarray:
    """Return a viewpoint (5,) drawn uniformly within a robot's reach, the gaze in any direction."""
    grid, reach_m, axes = view.scenario.grid, view.kind.robot.reach_m, 2 if view.planar else 3
    low = np.asarray(grid.origin_m)
    high = low + grid.size_m
    viewpoint = view.pose.copy()
    here = view.pose[:axes]
    if math.isinf(reach_m):  # actions reach from the centre of the first voxel to that of the last
        low, high = low + 0.5 * grid.voxel_size_m, high - 0.5 * grid.voxel_size_m
    lowest, highest = np.maximum(low[:axes], here - reach_m), np.minimum(high[:axes], here + reach_m)
    for _ in range(_DRAWS):
        place = rng.uniform(lowest, highest)
        if ((place - here) ** 2).sum() <= reach_m**2:
            viewpoint[:axes] = place
            break
    viewpoint[3] = rng.uniform(-math.pi, math.pi)
    viewpoint[4] = 0.0 if view.level else math.asin(rng.uniform(-1.0, 1.0))
    return viewpoint
