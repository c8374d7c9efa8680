"""The map of a mission's team."""

from __future__ import annotations

import numpy as np

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.missions.simulation import Missions


def joint_map(missions: Missions, mission: int = 0) -> Map:
    """Return what the team of a mission knows together.

    Where the truth is tracked (`Scenario.track_truth`) it is the map of everything that was measured, fused
    once. Elsewhere each voxel is that of the robot whose belief of it is surest: beliefs share measurements,
    which a product of Gaussians would count twice.
    """
    scenario, state, shape = missions.scenario, missions.state, missions.grid.shape
    if scenario.track_truth:
        mean, precision = state.joint_mean[mission], state.joint_precision[mission]
    else:
        mean, precision = state.mean[mission, 0].copy(), state.precision[mission, 0].copy()
        for robot in range(1, scenario.robots):
            surer = state.precision[mission, robot] > precision
            mean[surer] = state.mean[mission, robot][surer]
            precision[surer] = state.precision[mission, robot][surer]
    world = missions.worlds[mission]
    yaw_rad = 0.0 if world is None else float(world.yaw_rad)
    mean = np.clip(mean, 0.0, 1.0).reshape(shape)
    return Map(missions.grid, mean, precision.reshape(shape), scenario.sigma_prior, yaw_rad)
