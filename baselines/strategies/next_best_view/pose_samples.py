"""Poses that Sujan's rules choose among, and the known paths that lead there."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.frontiers.knowledge import centres_of, voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.planner.stops import straightened
from entropy_explore_env.robots.knowledge import RobotKnowledge

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
