"""The strategy `cliff-next-best-view`: mapping a cliff from above it (Sujan, sect. 3.2, methods 3-5).

A rover with a camera that pans and tilts maps an elevation map and must not drive over the edge. Of m poses
drawn on its plateau it takes the one with the best rating (eq. 23)

    RF = NI - w_d·d

NI is the new information over elevation (eq. 3), d the distance (eq. 22). The edge of the plateau is a
straight line (method 3) or a polygon (method 4), without or with the interest function of eq. 9 (method 5).

Ours: poses are drawn uniformly and look down by up to 60°.
"""

from __future__ import annotations

from typing import get_args

import numpy as np

from baselines.strategies.next_best_view.elevation_view import fill_new_information
from baselines.strategies.next_best_view.ground_map import EdgeForm, GroundMap, camera_of
from baselines.strategies.next_best_view.plateau_rule import STEEP_RAD, PlateauRule
from baselines.strategies.next_best_view.poses import drawn_poses, pose_distance, poses_in
from entropy_explore_env.errors import SettingError
from entropy_explore_env.robots.knowledge import RobotKnowledge

_POSES = 100
"""m, drawn at each decision."""
_DISTANCE_WEIGHT = 1.0
"""w_d, bits a metre or radian, against w_NI = 1."""
_MOST_MEASUREMENTS = 4.0
"""n_max of eq. 3."""


class CliffNextBestView(PlateauRule):
    """Goes to the pose on the plateau with the best rating."""

    rule = "cliff-next-best-view"

    def __init__(self, edge: EdgeForm = "polygon", interest_decay: float = 1.0) -> None:
        """Take the method; the defaults are method 5.

        Args:
            edge: Whether poses lie behind the straight `line` that fits the edge best, or in its `polygon`.
            interest_decay: β of eq. 9; 0 = no interest is lost.

        Raises:
            SettingError: One of them is not allowed.
        """
        if edge not in get_args(EdgeForm):
            raise SettingError("edge", edge, f"one of {', '.join(get_args(EdgeForm))}")
        if not 0.0 <= interest_decay <= 1e6:
            raise SettingError("interest_decay", interest_decay, "a number from 0 to 1e6")
        self.edge, self.interest_decay = edge, interest_decay

    def pick(self, view: RobotKnowledge, ground: GroundMap, reachable: np.ndarray) -> np.ndarray:
        """Return the best rated of the poses drawn; see `PlateauRule`."""
        voxels, gazes = drawn_poses(self._rng, reachable, _POSES, (0.0, STEEP_RAD))
        poses = poses_in(view, voxels, gazes)
        scaled, bits = np.stack([view.scenario.grid.in_grid_units(pose) for pose in poses]), np.empty(_POSES)
        fill_new_information(ground.ground(view), camera_of(view), _MOST_MEASUREMENTS, scaled, bits)
        distances = np.array([pose_distance(view.pose, pose) for pose in poses])
        best = int(np.argmax(bits - _DISTANCE_WEIGHT * distances))
        ground.expect(view, scaled[best])
        return poses[best]
