"""LE of the rating function (Sujan, eq. 23): how much less well a robot will know its pose at a viewpoint."""

from __future__ import annotations

import numpy as np

from baselines.strategies.next_best_view.pose_samples import path_points
from entropy_explore_env.frontiers.knowledge import belief_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.viewpoints.expected_localization import Drive, Surveyor, growth_of_error


def localization_error(view: RobotKnowledge, paths: KnownPaths, pose: np.ndarray) -> float:
    """Return LE of a drive on the known path to a pose (5,), in metres; 0 where its pose is exact.

    Points count as far away as the robot's latest scan measured on average, r̂.

    Args:
        view: Of the robot.
        paths: Through its known free space; their latest search begins where it stands.
        pose: Map frame.
    """
    if not isinstance(view, RobotView) or view.rules.localization is None:  # only missions have fiducials
        return 0.0
    grid, sensor, robot = view.scenario.grid, view.kind.sensor, view.kind.robot
    x, y, z = grid.origin_m
    scan_every_m = min(sensor.scan_every_m, robot.reach_m)
    surveyor = Surveyor(
        params=view.rules.localization[view.robot : view.robot + 1],
        landmarks_m=view.fiducials_m,
        mean=belief_of(view).mean,
        size=grid.shape,
        origin_m=(float(x), float(y), float(z)),
        voxel_size_m=float(grid.voxel_size_m),
        min_range_m=float(sensor.min_range_m),
        scan_every_m=float(scan_every_m),
        own=view.landmarks,
        matrices=np.empty((2, 4, 4)),
    )
    since_m = view.since_scan_m if scan_every_m == sensor.scan_every_m else 0.0
    drive = Drive(view.pose, path_points(view, paths, pose), pose, float(since_m))
    return float(growth_of_error(view.covariance, surveyor, drive, view.depth_m, np.empty((4, 4))))
