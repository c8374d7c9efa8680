"""The strategy `cliff-next-best-view`: mapping a cliff from above it (Sujan, sect. 3.2, methods 3-5).

A rover with a camera that pans and tilts maps an elevation map and must not drive over the edge. Of m poses
drawn on its plateau it takes the one with the best rating (eq. 23)

    RF = NI - w_d·d

NI is the new information over elevation (eq. 3), d the distance (eq. 22). The edge of the plateau is a
straight line (method 3) or a polygon (method 4), without or with the interest function of eq. 9 (method 5).

Ours: poses are drawn uniformly and look down by up to 60°.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baselines.strategies.next_best_view.elevation_view import fill_new_information
from baselines.strategies.next_best_view.ground_map import EdgeForm, GroundMap, camera_of
from baselines.strategies.next_best_view.plateau_rule import STEEP_RAD, PlateauRule, pose_at
from baselines.strategies.next_best_view.pose_samples import drawn_poses
from baselines.strategies.next_best_view.rating import pose_distance, rating
from entropy_explore_env.frontiers.knowledge import RobotKnowledge
from entropy_explore_env.validation import check_choice, check_within

_POSES = 100
"""m, drawn at each decision."""
_DISTANCE_WEIGHT = 1.0
"""w_d, bits a metre or radian, against w_NI = 1."""
_MOST_MEASUREMENTS = 4.0
"""n_max of eq. 3."""


@dataclass(frozen=True)
class CliffConfig:
    """How a next best view is chosen above a cliff.

    Attributes:
        edge: Whether poses lie behind the straight `line` that fits the edge best, or in its `polygon`.
        interest_decay: β of eq. 9; 0 = no interest is lost.

    Raises:
        SettingError: One of them is not allowed.
    """

    edge: EdgeForm = "polygon"
    interest_decay: float = 1.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "edge", EdgeForm)
        check_within(self, "interest_decay", least=0.0, most=1e6)


class CliffNextBestView(PlateauRule):
    """Goes to the pose on the plateau with the best rating."""

    rule = "cliff-next-best-view"

    def __init__(self, config: CliffConfig | None = None) -> None:
        """Take the settings; None = the defaults, method 5."""
        config = config or CliffConfig()
        self.edge, self.interest_decay = config.edge, config.interest_decay

    def pick(self, view: RobotKnowledge, ground: GroundMap, reachable: np.ndarray) -> np.ndarray:
        """Return the best rated of the poses drawn; see `PlateauRule`."""
        grid = self._scenario.grid
        columns, gazes = drawn_poses(self._rng, np.argwhere(reachable), _POSES, (0.0, STEEP_RAD))
        poses = [
            pose_at(view, column, yaw, pitch)
            for column, (yaw, pitch) in zip(columns, gazes.tolist(), strict=True)
        ]
        scaled, bits = np.stack([grid.in_grid_units(pose) for pose in poses]), np.empty(_POSES)
        fill_new_information(ground.ground(view), camera_of(view), _MOST_MEASUREMENTS, scaled, bits)
        worth = [
            rating(new, _DISTANCE_WEIGHT * pose_distance(view.pose, pose), 0.0)
            for new, pose in zip(bits.tolist(), poses, strict=True)
        ]
        best = int(np.argmax(worth))
        ground.expect(view, scaled[best])
        return poses[best]
