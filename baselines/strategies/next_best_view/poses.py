"""Poses drawn in known free space, paths to them, and rules that take the best of them (Sujan, sect. 3.1)."""

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
from entropy_explore_env.frontiers.knowledge import belief_of, centres_of, voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import NOWHERE, Goal, Scene
from entropy_explore_env.planner.stops import straightened
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import robot_model
from entropy_explore_env.viewpoints.expected_localization import Drive, Surveyor, growth_of_error

_LARGEST_OCCUPANCY = 0.05
_INTEREST_DECAY = 1.0
"""β of eq. 9: a voxel that did not answer keeps e^-β of the interest in it."""
_STEEPEST_RAD = math.pi / 4
"""Robots that look up and down draw their pitch within this."""
_NARROWEST_RAD = 0.1
"""Narrower views count as this wide where a robot looks all around."""


def reachable_voxels(traversal_cost: np.ndarray, paths: KnownPaths) -> np.ndarray:
    """Return (N,) int32 voxels in which the body is known to fit, with a known free path there.

    Args:
        traversal_cost: (V,) inf where it is not.
        paths: Whose latest search begins where the robot stands; it is extended.
    """
    paths.extend(math.inf)
    voxels = np.flatnonzero(np.isfinite(traversal_cost)).astype(np.int32)
    return voxels[np.isfinite(paths.lengths_to(voxels))]


def path_points(view: RobotKnowledge, paths: KnownPaths, pose: np.ndarray) -> np.ndarray:
    """Return (N, 3) points of the known path to a pose by the latest search, pulled straight, map frame."""
    goal = voxel_of(view, pose)
    if goal == voxel_of(view, view.pose):
        return pose[None, :3].copy()
    return straightened(view, paths, paths.route_to(goal), pose)


def drawn_poses(
    rng: np.random.Generator, voxels: np.ndarray, number: int, pitches_rad: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Draw poses uniformly: their voxels, and (number, 2) yaws and pitches.

    Args:
        rng: Draws them.
        voxels: (N,) each as likely as any other.
        number: Of poses.
        pitches_rad: The lowest and the highest; yaws lie all around.
    """
    drawn = voxels[rng.integers(len(voxels), size=number)]
    yaws = rng.uniform(-math.pi, math.pi, number)
    return drawn, np.stack([yaws, rng.uniform(*pitches_rad, number)], axis=1)


def yaws_around(wide_rad: float) -> list[float]:
    """Return as few yaws, evenly spaced from 0, as show all around with a view of a width."""
    turns = math.ceil(2.0 * math.pi / max(wide_rad, _NARROWEST_RAD) - 1e-9)
    return [2.0 * math.pi * turn / turns for turn in range(turns)]


def poses_in(view: RobotKnowledge, voxels: int | np.ndarray, gazes: np.ndarray) -> np.ndarray:
    """Return the poses (..., 5) in the middle of (...) voxels with (..., 2) yaws and pitches, map frame."""
    return np.concatenate([centres_of(view, voxels), gazes], axis=-1)


def pose_distance(pose: np.ndarray, viewpoint: np.ndarray) -> float:
    """Return D of eq. 22 with all α = 1, between poses (5,): x, y, z in metres, yaw and pitch in radians."""
    apart = viewpoint - pose
    apart[3] = (apart[3] + math.pi) % (2.0 * math.pi) - math.pi
    return float(np.linalg.norm(apart))


def localization_error(view: RobotKnowledge, paths: KnownPaths, pose: np.ndarray) -> float:
    """Return LE of a drive on the known path to a pose (5,), in metres; 0 where its pose is exact.

    LE is how much less well the robot will know its pose there (Sujan, eq. 23).
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
    drive = Drive(view.pose.copy(), path_points(view, paths, pose), pose, float(since_m))
    return float(growth_of_error(view.covariance, surveyor, drive, view.depth_m, np.empty((4, 4))))


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
    extrapolates = False
    """Whether unknown cells of a plan take the mean occupancy of their neighbours; else ½."""
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
            look(known, scan, grid.in_grid_units(pose), self.seen)
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
        expectations.interest[silent] *= math.exp(-_INTEREST_DECAY)
