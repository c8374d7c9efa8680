"""Next-best-view mapping, and the four ways of choosing poses that its paper compares it with.

Sujan & Meggiolaro, "Simultaneous Localization and Mapping for Mobile Robot Teams with Visual Sensors". Of m
poses drawn in known free space (P_occ < 0.05) that a known free path reaches, a robot takes (sect. 3.1)

- `next-best-view`: the one with the best rating RF = (NI - w_d·d - w_LE·LE)·(1 - P_occ) (eq. 23), method (v);
- `most-unmapped`: the one that shows the largest unmapped region, method (iii);
- `least-mapped`: the one that shows the smallest mapped region, method (iv);
- `random-known`: the first, method (i).

`raster` takes the next place in row order that it has not scanned from, method (ii), and looks in all
directions there, or (`raster-fixed-yaw`) in one. Teams share their maps, and each robot chooses by itself.

Unknown cells of a plan take the mean occupancy of their neighbours, for `next-best-view` alone, as in the
paper; of plans of more than 200 × 200 cells, ours, those that can be seen from known ones. A voxel that
should have been visible and did not answer loses interest (eq. 9). LE, which the paper leaves open, is how
much less exact points will be that the robot measures there: what the way adds to the covariance of its
pose, less what fiducials take back that it should sight on it; 0 where it does not drift.

Ours, where the paper says nothing: poses are drawn uniformly, a new set at each decision; the spacing of
raster's places; where its latest scan showed no new voxel, methods (iii) and (iv) take a random pose, since
they would take the same nook for ever; a world with an exposure surface is refused.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from baselines.strategies.next_best_view.expected_view import (
    OccupancyMap,
    extrapolated,
    look,
    new_scratch,
    new_view,
    occupancy_map,
    voxels_in_view,
)
from baselines.strategies.next_best_view.known_space import KnownSpace, Memory
from baselines.strategies.next_best_view.localization_error import LocalizationError
from baselines.strategies.next_best_view.rating import UNCERTAINTY, new_information, pose_distance, rating
from entropy_explore_env.frontiers.knowledge import belief_of, voxel_of
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check_choice, check_count, check_kind, check_within
from entropy_explore_env.viewpoints.evaluation import robot_model

Choice = Literal["information", "most-unmapped", "least-mapped", "random"]
Measure = Literal["uncertainty", "stretched", "linear"]
_BY_COUNT = ("most-unmapped", "least-mapped")
_LARGEST_OCCUPANCY = 0.05
_STEEPEST_RAD = math.pi / 4
"""Robots that look up and down draw their pitch within this."""


@dataclass(frozen=True)
class NextBestViewConfig:
    """How poses are chosen.

    Attributes:
        choice: `information`, `most-unmapped`, `least-mapped` or `random`: see the top of the file.
        poses: m, drawn at each decision.
        distance_weight: w_d, bits a metre or radian, against w_NI = 1.
        error_weight: w_LE, bits a metre of error, likewise.
        measure: New information by eq. 8, `uncertainty`, which the paper thinks better, or by eqs. 6-7,
            `stretched`; `linear` is eq. 8 with q in place of -q log2 q, ours.
        extrapolated: Whether unknown cells of a plan take the mean occupancy of their neighbours; else ½.
        interest_decay: β of eq. 9: a voxel that did not answer keeps e^-β of the interest in it.

    Raises:
        SettingError: One of them is not allowed.
    """

    choice: Choice = "information"
    poses: int = 100
    distance_weight: float = 0.01
    error_weight: float = 0.0
    measure: Measure = "uncertainty"
    extrapolated: bool = True
    interest_decay: float = 1.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "choice", Choice)
        check_choice(self, "measure", Measure)
        check_kind(self, "extrapolated", bool)
        check_count(self, "poses", 1, 100_000)
        check_within(self, "distance_weight", "error_weight", "interest_decay", least=0.0, most=1e6)


class NextBestView(KnownSpace):
    """Takes the best of poses drawn in known free space; see the top of the file."""

    def __init__(self, config: NextBestViewConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or NextBestViewConfig()
        self.interest_decay = self.config.interest_decay

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        super().reset(scenario, rng)
        voxels = scenario.grid.voxels
        self._models = {kind: robot_model(scenario, kind, thinning=1) for kind in set(scenario.kinds)}
        self._most_in_view = {
            kind: voxels_in_view(model.scan, kind.sensor.field_of_view_rad, scenario.grid.flat, voxels)
            for kind, model in self._models.items()
        }
        longest = max(model.longest_ray for model in self._models.values())
        self._error: LocalizationError | None = None
        self._view, self._scratch = new_view(voxels), new_scratch(voxels, longest + 1)

    def pick(self, view: RobotView, memory: Memory, reachable: np.ndarray) -> np.ndarray | None:
        """See `KnownSpace`."""
        prior = self._scenario.sigma_prior**-2
        known = occupancy_map(belief_of(view), prior, memory.interest)
        free = reachable[known.occupancy[reachable] < _LARGEST_OCCUPANCY]
        if len(free) == 0:
            return None
        poses = self._drawn(view, free)
        measured = int(len(known.unknown) - known.unknown.sum())
        nothing_new, memory.measured = measured == memory.measured, measured
        if self.config.choice == "random" or (nothing_new and self.config.choice in _BY_COUNT):
            return poses[0]
        if self.config.choice == "information" and self.config.extrapolated:
            scan = self._models[view.kind].scan
            known = extrapolated(known, memory.occupancy, scan.max_range_m / scan.voxel_size_m)
            memory.occupancy = known.occupancy
        self._error = LocalizationError(view, memory.paths) if self.config.error_weight > 0.0 else None
        best, expected = poses[0], memory.expected
        most = -math.inf
        for pose in poses:
            worth = self._worth(view, known, pose)
            if worth > most:
                most, best = worth, pose
                expected = self._view.seen[: self._view.counts[1]].copy()
        memory.expected = expected
        return best

    def _drawn(self, view: RobotView, free: np.ndarray) -> list[np.ndarray]:
        """Poses in known free space, each voxel as likely as any other, the gaze in any direction."""
        voxels = self._rng.choice(free, self.config.poses if self.config.choice != "random" else 1)
        yaws = self._rng.uniform(-math.pi, math.pi, len(voxels))
        pitches = self._rng.uniform(-_STEEPEST_RAD, _STEEPEST_RAD, len(voxels))
        drawn = zip(voxels, yaws, pitches, strict=True)
        return [self.pose_in(view, int(voxel), float(yaw), float(pitch)) for voxel, yaw, pitch in drawn]

    def _worth(self, view: RobotView, known: OccupancyMap, pose: np.ndarray) -> float:
        """What a pose is worth by the choice that the settings name; `self._view` is what it shows."""
        config, grid = self.config, self._scenario.grid
        scan = self._models[view.kind].scan
        stretched = config.measure == "stretched"
        look(known, scan, grid.in_grid_units(pose), stretched, self._scratch, self._view)
        if config.choice == "most-unmapped":
            return float(self._view.counts[1])
        if config.choice == "least-mapped":
            return -float(self._view.counts[0])
        weights = None if stretched else UNCERTAINTY
        linear, most = config.measure == "linear", self._most_in_view[view.kind]
        bits = new_information(self._view.shares, most, weights, linear)
        occupancy = float(known.occupancy[voxel_of(view, pose)])
        error_m = 0.0 if self._error is None else self._error.at(pose)
        costs = config.distance_weight * pose_distance(view.pose, pose) + config.error_weight * error_m
        return rating(bits, costs, occupancy)
