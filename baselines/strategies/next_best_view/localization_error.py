"""LE of the rating function (Sujan, eq. 23): how much less well a robot will know its pose at a viewpoint."""

from __future__ import annotations

import numpy as np

from entropy_explore_env.frontiers.knowledge import belief_of, voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.viewpoints.expected_localization import Drive, Surveyor, growth_of_error


class LocalizationError:
    """What drives to viewpoints do to one robot's estimate, at one of its decisions."""

    def __init__(self, view: RobotView, paths: KnownPaths) -> None:
        """Begin with the robot as it is.

        Args:
            view: Of the robot.
            paths: Through its known free space; their latest search begins where it stands.
        """
        grid, sensor, robot = view.scenario.grid, view.kind.sensor, view.kind.robot
        self._view, self._paths, self._here = view, paths, voxel_of(view, view.pose)
        self._after = np.empty((4, 4))
        self._surveyor = None
        if view.rules.localization is not None:
            low = grid.origin_m
            self._surveyor = Surveyor(
                params=view.rules.localization[view.robot : view.robot + 1],
                landmarks_m=view.fiducials_m,
                mean=belief_of(view).mean,
                size=grid.shape,
                origin_m=(float(low[0]), float(low[1]), float(low[2])),
                voxel_size_m=float(grid.voxel_size_m),
                min_range_m=float(sensor.min_range_m),
                scan_every_m=float(min(sensor.scan_every_m, robot.reach_m)),
                own=view.landmarks,
                matrices=np.empty((2, 4, 4)),
            )

    def at(self, pose: np.ndarray) -> float:
        """LE of a drive on the known path to a pose (5,), in metres; 0 where robots know where they are.

        Points count as far away as the robot's latest scan measured on average, r̂.
        """
        view = self._view
        if self._surveyor is None:
            return 0.0
        since_m = view.since_scan_m if self._surveyor.scan_every_m == view.kind.sensor.scan_every_m else 0.0
        drive = Drive(view.pose, self._path_to(pose), pose, float(since_m))
        return float(growth_of_error(view.covariance, self._surveyor, drive, view.depth_m, self._after))

    def _path_to(self, pose: np.ndarray) -> np.ndarray:
        """(N, 3) points of the known path to a pose, pulled straight, in metres."""
        view, grid = self._view, self._view.scenario.grid
        goal = voxel_of(view, pose)
        if goal == self._here:
            return pose[None, :3].copy()
        route = self._paths.route_to(goal)
        start, end = (grid.in_grid_units(place)[:3] for place in (view.pose, pose))
        if self._paths.lattice.layer >= 0:
            end[2] = start[2]
        corners = self._paths.corners_of(route, start, end)
        return np.asarray(grid.origin_m) + corners * grid.voxel_size_m
