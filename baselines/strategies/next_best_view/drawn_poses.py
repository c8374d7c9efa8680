"""Rules that send robots to the best of poses drawn in known free space (Sujan, sect. 3.1)."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, field

import numpy as np

from baselines.strategies.next_best_view.expected_view import (
    OccupancyMap,
    extrapolated,
    look,
    new_view,
    occupancy_map,
)
from baselines.strategies.next_best_view.pose_samples import drawn_poses, poses_in, reachable_voxels
from entropy_explore_env.frontiers.knowledge import belief_of
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import NOWHERE, Goal, Scene
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import robot_model

_LARGEST_OCCUPANCY = 0.05
_STEEPEST_RAD = math.pi / 4
"""Robots that look up and down draw their pitch within this."""


@dataclass
class Expectations:
    """What one robot expects of the voxels of its map."""

    interest: np.ndarray
    """(V,) float32, eq. 9."""
    occupancy: np.ndarray | None = None
    """(V,) float32 as extrapolated at the latest decision."""
    measured: int = 0
    """Voxels that were measured at the latest decision."""
    visible: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    """Unknown voxels that should be visible from the goal."""


class DrawnPoses(FrontierRule):
    """Goes to the best of poses drawn in known free space: a rule is a subclass with `worth`.

    Attributes:
        seen: What is expected to be seen from the pose that is rated.
    """

    until_reached, refines, turns_first = True, False, False
    poses = 100
    """m, drawn at each decision."""
    interest_decay = 1.0
    """β of eq. 9: a voxel that did not answer keeps e^-β of the interest in it."""
    extrapolates = False
    """Whether unknown cells of a plan take the mean occupancy of their neighbours; else ½."""
    stretches = False
    """Whether occupancies are stretched by distance (eq. 7)."""
    escapes = False
    """Whether a robot takes the first pose where its latest scan showed no new voxel."""

    @abstractmethod
    def worth(self, scene: Scene, known: OccupancyMap, pose: np.ndarray) -> float:
        """Return what a pose (5,), map frame, is worth; `self.seen` is what a scan there should show."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        voxels = scenario.grid.voxels
        models = {kind: robot_model(scenario, kind, thinning=1) for kind in set(scenario.kinds)}
        self._scans = {kind: model.scan for kind, model in models.items()}
        self.seen = new_view(voxels, max(model.longest_ray for model in models.values()))
        self._expectations = [Expectations(np.ones(voxels, np.float32)) for _ in range(scenario.robots)]

    def pick(self, scene: Scene) -> Goal:
        """Return the best of the poses drawn; see `FrontierRule`."""
        view, expectations = scene.view, self._expectations[scene.view.robot]
        expectations.visible = expectations.visible[:0]
        known = occupancy_map(belief_of(view), self._scenario.sigma_prior**-2, expectations.interest)
        reachable = reachable_voxels(scene.cells.traversal_cost, scene.paths)
        free = reachable[known.occupancy[reachable] < _LARGEST_OCCUPANCY]
        if len(free) == 0:
            return NOWHERE
        voxels, gazes = drawn_poses(self._rng, free, self.poses, (-_STEEPEST_RAD, _STEEPEST_RAD))
        if view.level:
            gazes[:, 1] = 0.0
        measured = int(len(known.unknown) - known.unknown.sum())
        in_vain, expectations.measured = measured == expectations.measured, measured
        best = 0
        if not (in_vain and self.escapes):
            best = self._best(scene, known, poses_in(view, voxels, gazes))
        yaw, pitch = gazes[best].tolist()
        return Goal(int(voxels[best]), int(voxels[best]), gaze=(yaw, pitch))

    def _best(self, scene: Scene, known: OccupancyMap, poses: np.ndarray) -> int:
        """Return which of the poses (K, 5) is worth most, the first of equals."""
        grid, expectations = self._scenario.grid, self._expectations[scene.view.robot]
        scan = self._scans[scene.view.kind]
        if self.extrapolates:
            known = extrapolated(known, expectations.occupancy, scan.max_range_m / scan.voxel_size_m)
            expectations.occupancy = known.occupancy
        best, most = 0, -math.inf
        for number, pose in enumerate(poses):
            look(known, scan, grid.in_grid_units(pose), self.stretches, self.seen)
            worth = self.worth(scene, known, pose)
            if worth > most:
                best, most = number, worth
                expectations.visible = self.seen.seen[: self.seen.counts[1]].copy()
        return best

    def arrive(self, view: RobotKnowledge, cells: VoxelFrontiers, here: int) -> None:
        """Lose interest in voxels that should have been visible and did not answer (eq. 9, with P_V = 1)."""
        expectations = self._expectations[view.robot]
        precision = view.precision.reshape(-1)[expectations.visible]
        silent = expectations.visible[precision <= np.float32(self._scenario.sigma_prior**-2)]
        expectations.interest[silent] *= math.exp(-self.interest_decay)
