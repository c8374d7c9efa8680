"""How long it takes to get to viewpoints on planned paths.

Grid units; a path's length is that of its steps from voxel to voxel, less what straight lines save.
"""

from __future__ import annotations

import math

from entropy_explore_env.belief.paths.search import cost_to
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.robots.motion import driving_time, turning_time

STRAIGHTENED = 0.96
"""Length of a path after string pulling, as a share of the sum of its steps."""
WITHIN = 1.0 - 1e-6
"""Of the reach: actions are float32."""


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
