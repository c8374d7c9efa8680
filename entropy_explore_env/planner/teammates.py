"""Where teammates are and go to, by what a robot heard: what coordinated rules share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.frontiers.knowledge import stays, teammates_that_share, under_way, voxel_of
from entropy_explore_env.planner.frontier_rule import Scene


class Team(NamedTuple):
    """Teammates of which a robot has heard and whose scans reach it, in two groups."""

    places: np.ndarray
    """(M,) int32 voxels where those were who choose anew now, as far as the robot knows."""
    targets: np.ndarray
    """(N, 3) places in voxel edges to which the others are under way."""


def team_of(scene: Scene) -> Team:
    """The teammates of a scene's robot."""
    view, places, targets = scene.view, [], []
    for mate, seen in teammates_that_share(view).items():
        if seen.heard_s < 0.0 and seen.announced_s < 0.0:
            continue
        if under_way(view, seen, mate) and not stays(view, seen):
            targets.append(view.scenario.grid.in_grid_units(seen.viewpoint)[:3])
        elif seen.heard_s >= 0.0:
            places.append(voxel_of(view, seen.pose))
    return Team(np.array(places, np.int32), np.array(targets, np.float64).reshape(-1, 3))


def centres_of(scene: Scene, voxels: np.ndarray) -> np.ndarray:
    """(K, 3) centres of (K,) voxels, in voxel edges."""
    return np.stack(np.unravel_index(voxels, scene.view.scenario.grid.shape), axis=-1) + 0.5


def left_to_robot(scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """(K,) bool, frontier cells that are nearer to the robot than to where teammates go; all if none is.

    Args:
        scene: Of the robot.
        voxels: (K,) int32, the cells.
        lengths: (K,) of the robot's paths to them, in voxel edges.
    """
    own, places = np.ones(len(voxels), bool), centres_of(scene, voxels)
    for target in team_of(scene).targets:
        own &= lengths <= np.linalg.norm(places - target, axis=1)
    return own if own.any() else np.ones(len(voxels), bool)


def lengths_of_all(scene: Scene, voxels: np.ndarray, lengths: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(1 + M, K) lengths of paths from the robot, then from M teammates' voxels, to K frontier cells.

    The robot's own are `lengths`. Teammates are assumed to have the robot's own map.
    """
    return np.array([lengths, *(scene.paths.lengths_from(int(place), voxels) for place in places)])
