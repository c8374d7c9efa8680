"""Where a robot stops on its way to a place that is farther than one drive may lead."""

from __future__ import annotations

import numpy as np

from entropy_explore_env.frontiers.knowledge import centres_of, voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.robots.knowledge import RobotKnowledge

WITHIN_REACH = 0.999
"""Share of the reach that is used, so that rounding never moves a place towards the robot."""


def stop_towards(
    view: RobotKnowledge, paths: KnownPaths, here: int, goal: np.ndarray, at_corners: bool = False
) -> np.ndarray:
    """Return the farthest place (3,) on the known path to a goal to which one drive leads.

    A robot that plans drives to the last place of the path within its reach; one that drives straight, or
    scans at corners, to the first corner of the path, pulled straight.

    Args:
        view: Of the robot.
        paths: Through its known free space; a new search is made.
        here: The voxel in which it stands.
        goal: (3,) or more numbers, in metres, map frame; itself where no path leads there.
        at_corners: Whether a robot that plans stops at corners, too.
    """
    robot, goal = view.kind.robot, goal[:3]
    reach_m = robot.reach_m * WITHIN_REACH
    passes_corners = robot.navigator == "planned" and not at_corners
    if passes_corners and apart_m(view, goal) <= reach_m:
        return goal
    path = paths.path_to(here, voxel_of(view, goal))
    if len(path) == 0:
        return goal
    if passes_corners:
        places, axes = centres_of(view, path), 2 if view.planar else 3
        beyond = np.flatnonzero(np.linalg.norm(places[:, :axes] - view.pose[:axes], axis=1) > reach_m)
        last = (int(beyond[0]) if len(beyond) else len(path)) - 1
        return np.asarray(places[max(last, 0)])
    first = straightened(view, paths, path, goal)[0]
    return np.asarray(
        view.pose[:3] + (first - view.pose[:3]) * min(1.0, reach_m / max(apart_m(view, first), 1e-9))
    )


def straightened(view: RobotKnowledge, paths: KnownPaths, path: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Return (N, 3) points of a path of the latest search, pulled straight, map frame; the goal last.

    Args:
        view: Of the robot, at which the path begins.
        paths: Through its known free space.
        path: (V,) int32 its voxels.
        goal: (3,) or more numbers, in metres, map frame; of planar robots in their plane.
    """
    grid = view.scenario.grid
    start, end = (grid.in_grid_units(place[:3]) for place in (view.pose, goal))
    if paths.lattice.layer >= 0:
        end[2] = start[2]
    corners = paths.corners_of(path, start, end)
    return np.asarray(grid.origin_m) + (corners if len(corners) else end[None]) * grid.voxel_size_m


def apart_m(view: RobotKnowledge, place: np.ndarray) -> float:
    """Return the straight distance from a robot to a place, map frame; of planar robots along the plane."""
    axes = 2 if view.planar else 3
    return float(np.linalg.norm(place[:axes] - view.pose[:axes]))
