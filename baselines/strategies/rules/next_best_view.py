"""The strategy `next-best-view` (Sujan & Meggiolaro, sects. 2.3 and 3.1, method v).

"Simultaneous Localization and Mapping for Mobile Robot Teams with Visual Sensors". Of m poses drawn in known
free space (P_occ < 0.05) that a known free path reaches, a robot takes the one with the best rating (eq. 23)

    RF = (NI - w_d·d - w_LE·LE)·(1 - P_occ)

NI is the new information in the view from there (eq. 8), d the distance to it (eq. 22). Robots share their
maps and do not coordinate. Unknown cells of a plan take the mean occupancy of their neighbours; in plans of
more than 200 × 200 cells, ours, only those that can be seen from known ones. A voxel that should have been
visible and did not answer loses interest (eq. 9). LE, which the paper leaves open, is how much less exact
points will be that the robot measures there: what the way adds to the covariance of its pose, less what
fiducials take back; 0 where robots do not drift.

Ours, where the paper says nothing: poses are drawn uniformly, a new set at each decision.
"""

from __future__ import annotations

import numpy as np

from baselines.strategies.next_best_view.expected_view import (
    OccupancyMap,
    new_information,
    voxels_in_view,
)
from baselines.strategies.next_best_view.poses import DrawnPoses, localization_error, pose_distance
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.knowledge import voxel_of
from entropy_explore_env.planner.scene import Scene

_DISTANCE_WEIGHT = 0.01
"""w_d, bits a metre or radian, against w_NI = 1."""


class NextBestView(DrawnPoses):
    """Goes to the pose with the best rating."""

    rule = "next-best-view"

    extrapolates = True

    def __init__(self, error_weight: float = 0.0) -> None:
        """Take w_LE, bits a metre of error.

        Raises:
            SettingError: It is no number from 0 to 1e6.
        """
        if not 0.0 <= error_weight <= 1e6:
            raise SettingError("error_weight", error_weight, "a number from 0 to 1e6")
        self.error_weight = error_weight

    def worth(self, scene: Scene, known: OccupancyMap, pose: np.ndarray) -> float:
        """Return RF of a pose; see `DrawnPoses`."""
        view = scene.view
        bits = new_information(self.seen.shares, voxels_in_view(view.kind.sensor, view.scenario.grid))
        costs = _DISTANCE_WEIGHT * pose_distance(view.pose, pose)
        if self.error_weight > 0.0:
            costs += self.error_weight * localization_error(view, scene.paths, pose)
        return (bits - costs) * (1.0 - float(known.occupancy[voxel_of(view, pose)]))
