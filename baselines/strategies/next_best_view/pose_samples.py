"""Poses that Sujan's rules choose among, the known paths that lead there, and terms of their ratings."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.frontiers.knowledge import belief_of, centres_of, voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.planner.stops import straightened
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.viewpoints.expected_localization import Drive, Surveyor, growth_of_error

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
    drive = Drive(view.pose, path_points(view, paths, pose), pose, float(since_m))
    return float(growth_of_error(view.covariance, surveyor, drive, view.depth_m, np.empty((4, 4))))
