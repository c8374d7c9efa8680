"""Getting to viewpoints on planned paths: seconds, and the first stop on a path.

Grid units; a path's length is that of its steps from voxel to voxel, less what straight lines save.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import Costs, Lattice
from entropy_explore_env.belief.paths.search import Search, cost_to, extract_path
from entropy_explore_env.belief.paths.string_pulling import string_pulled
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.robots.motion import driving_time, turning_time

STRAIGHTENED = 0.96
"""Length of a path after string pulling, as a share of the sum of its steps."""
WITHIN = 1.0 - 1e-6
"""Of the reach: actions are float32."""


class Travel(NamedTuple):
    """A search for paths from where a robot is."""

    search: Search
    lattice: Lattice
    costs: Costs
    start: np.ndarray
    """(3,) float64, the robot in grid units."""


@lean_kernel
def travel_seconds(search, size, drive, voxel_size_m, here, viewpoints, reach, seconds):
    """Fill in the seconds until the scans at viewpoints are taken, on planned paths.

    A path longer than the reach is driven in equal hops from rest to rest, with a scan after each.

    Args:
        search: The latest search, from the robot's voxel.
        size: (X, Y, Z) voxels.
        drive: A DriveModel.
        voxel_size_m: Edge of a voxel.
        here: (5,) the robot, in grid units.
        viewpoints: (K, 5) in grid units.
        reach: Longest hop in voxel edges; inf allowed.
        seconds: (K,) float64, filled in; inf = not reached.
    """
    for k in range(len(viewpoints)):
        at = viewpoints[k]
        voxel = flat_index(
            size, min(int(at[0]), size[0] - 1), min(int(at[1]), size[1] - 1), min(int(at[2]), size[2] - 1)
        )
        straight = math.sqrt((at[0] - here[0]) ** 2 + (at[1] - here[1]) ** 2 + (at[2] - here[2]) ** 2)
        length = 0.0
        if straight > 1e-9:
            length = max(straight, STRAIGHTENED * cost_to(search, voxel))
        if math.isinf(length):
            seconds[k] = math.inf
            continue
        hops = max(math.ceil(length / reach - 1e-9), 1)
        hop_m = length / hops * voxel_size_m
        drive_s = hops * driving_time(hop_m, drive.max_speed_m_s, drive.acceleration_m_s2)
        drive_s += (hops - 1) * drive.scan_time_s
        turn_s = turning_time(here[3], here[4], at[3], at[4], drive.turn_rate_rad_s)
        seconds[k] = max(drive_s, turn_s) + drive.scan_time_s


def first_stop(travel: Travel, goal: np.ndarray, reach: float, planned: bool) -> np.ndarray | None:
    """Where a robot has to drive first to get to a goal.

    Args:
        travel: The latest search.
        goal: (3,) in grid units.
        reach: Longest drive in voxel edges.
        planned: Whether the robot's navigator finds the path between stops; else it drives straight.

    Returns:
        (3,) in grid units: the goal where it is within reach, or the last place of the path that is; None =
        there is no path.
    """
    size, start = travel.lattice.size, travel.start
    voxel = int(np.ravel_multi_index(tuple(goal.astype(int)), size))
    count = extract_path(travel.search, travel.lattice, voxel, np.empty(0, np.int32))
    if count == 0:
        return None
    if planned and np.linalg.norm(goal - start) <= reach * WITHIN:
        return goal.copy()
    path = np.empty(count, np.int32)
    extract_path(travel.search, travel.lattice, voxel, path)
    if not planned:
        points = string_pulled(travel.search, travel.lattice, travel.costs, path, start.copy(), goal.copy())
        step = points[0] - start
        return start + step * min(1.0, reach * WITHIN / max(float(np.linalg.norm(step)), 1e-9))
    places = np.stack(np.unravel_index(path, size), axis=-1) + 0.5
    if travel.lattice.layer >= 0:
        places[:, 2] = start[2]
    outside = np.flatnonzero(np.linalg.norm(places - start, axis=1) > reach * WITHIN)
    return places[max(int(outside[0]) - 1, 0)] if len(outside) else places[-1]
