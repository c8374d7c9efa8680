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

from dataclasses import dataclass
from typing import Literal

import numpy as np

from baselines.strategies.next_best_view.expected_view import (
    UNCERTAINTY,
    OccupancyMap,
    new_information,
    voxels_in_view,
)
from baselines.strategies.next_best_view.poses import DrawnPoses, localization_error, pose_distance
from entropy_explore_env.frontiers.knowledge import voxel_of
from entropy_explore_env.planner.scene import Scene
from entropy_explore_env.settings.validation import check_choice, check_count, check_kind, check_within

Measure = Literal["uncertainty", "stretched", "linear"]


@dataclass(frozen=True)
class NextBestViewConfig:
    """How poses are rated.

    Attributes:
        poses: m, drawn at each decision.
        distance_weight: w_d, bits a metre or radian, against w_NI = 1.
        error_weight: w_LE, bits a metre of error.
        measure: New information by eq. 8, `uncertainty`, which the paper prefers, or by eqs. 6-7,
            `stretched`; `linear` is eq. 8 with q in place of -q log2 q, ours.
        extrapolated: Whether unknown cells of a plan take the mean occupancy of their neighbours; else ½.
        interest_decay: β of eq. 9: a voxel that did not answer keeps e^-β of the interest in it.

    Raises:
        SettingError: One of them is not allowed.
    """

    poses: int = 100
    distance_weight: float = 0.01
    error_weight: float = 0.0
    measure: Measure = "uncertainty"
    extrapolated: bool = True
    interest_decay: float = 1.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "measure")
        check_kind(self, "extrapolated", bool)
        check_count(self, "poses", 1, 100_000)
        check_within(self, "distance_weight", "error_weight", "interest_decay", least=0.0, most=1e6)


class NextBestView(DrawnPoses):
    """Goes to the pose with the best rating."""

    rule = "next-best-view"

    def __init__(self, config: NextBestViewConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or NextBestViewConfig()
        self.poses, self.interest_decay = self.config.poses, self.config.interest_decay
        self.extrapolates = self.config.extrapolated
        self.stretches = self.config.measure == "stretched"

    def worth(self, scene: Scene, known: OccupancyMap, pose: np.ndarray) -> float:
        """Return RF of a pose; see `DrawnPoses`."""
        view, config = scene.view, self.config
        most = voxels_in_view(view.kind.sensor, view.scenario.grid)
        weights = None if self.stretches else UNCERTAINTY
        bits = new_information(self.seen.shares, most, weights, linear=config.measure == "linear")
        costs = config.distance_weight * pose_distance(view.pose, pose)
        if config.error_weight > 0.0:
            costs += config.error_weight * localization_error(view, scene.paths, pose)
        return (bits - costs) * (1.0 - float(known.occupancy[voxel_of(view, pose)]))
