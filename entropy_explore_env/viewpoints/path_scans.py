"""The scans that a robot takes on the path to a viewpoint, and the bits of all of them; grid units."""

from __future__ import annotations

import math

from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.viewpoints.gathered_bits import gathered_bits
from entropy_explore_env.viewpoints.imagined_scan import imagine_scan
from entropy_explore_env.viewpoints.travel import STRAIGHTENED

_ROUNDING = 1e-6
"""A scan under way so near to a drive's end, as a share of the drive, is the one that is taken there."""


@lean_kernel
def fill_path_scans(lattice, size, path, count, here, at, every, since_scan, reach, scan_poses):
    """Fill in poses of scans on the path to a viewpoint, spread evenly over all that are taken there.

    A robot scans after every `every` voxel edges of a drive. A path that is longer than its reach is driven
    in equal hops, with a scan at each stop. A path leads over the centres of voxels, and is driven
    STRAIGHTENED times their distances.

    Args:
        lattice: Of the search; where it is one layer, all scans are at the robot's height.
        size: (X, Y, Z) voxels.
        path: (V,) int32, voxels from the robot's to the viewpoint's.
        count: Number of voxels of the path; 0 or 1 = the robot drives straight.
        here: (5,) the robot.
        at: (5,) the viewpoint, whose gaze is taken to be that of all the scans.
        every: Voxel edges from one scan under way to the next; inf = none is taken.
        since_scan: Voxel edges that it has driven since its latest scan.
        reach: Longest drive, voxel edges; inf allowed.
        scan_poses: (N, 5), of which the first are filled in.

    Returns:
        Number of poses that were filled in; the scan at the viewpoint itself is not among them.
    """
    most, steps = len(scan_poses), 0.0
    straight = math.sqrt((at[0] - here[0]) ** 2 + (at[1] - here[1]) ** 2 + (at[2] - here[2]) ** 2)
    for step in range(1, count):
        steps += _step_length(size, path[step - 1], path[step])
    length = max(straight, STRAIGHTENED * steps)
    if most == 0 or length <= 0.0:
        return 0
    hops = max(math.ceil(length / reach - 1e-9), 1)
    hop = length / hops
    first, each = _scans_under_way(hop, every, since_scan), _scans_under_way(hop, every, 0.0)
    scans = first + (hops - 1) * (each + 1)
    taken, passed, step = min(scans, most), 0.0, 1
    for number in range(taken):
        scan = (2 * (number + 1) * (scans + 1) + taken + 1) // (2 * (taken + 1))
        share = min(_driven_at(scan, first, each, hop, every, since_scan) / length, 1.0)
        pose = scan_poses[number]
        for axis in range(5):
            pose[axis] = at[axis]
        if count > 1:
            while step < count:
                ahead = _step_length(size, path[step - 1], path[step])
                if passed + 0.5 * ahead > share * steps:
                    break
                passed += ahead
                step += 1
            x, y, z = grid_index(size, path[step - 1])
            pose[0], pose[1] = x + 0.5, y + 0.5
            pose[2] = here[2] if lattice.layer >= 0 else z + 0.5
        else:
            for axis in range(3):
                pose[axis] = here[axis] + share * (at[axis] - here[axis])
    return taken


@lean_kernel
def _scans_under_way(drive, every, since_scan):
    """How many scans are taken on a drive, that at its end not among them."""
    if math.isinf(every):
        return 0
    return max(math.ceil((drive * (1.0 - _ROUNDING) + since_scan) / every) - 1, 0)


@lean_kernel
def _driven_at(scan, first, each, hop, every, since_scan):
    """Voxel edges driven at a scan of this number, from 1: on the first hop `first` of them, then `each`."""
    if scan <= first:
        return max(scan * every - since_scan, 0.0)
    hops, under_way = (scan - first - 1) // (each + 1) + 1, (scan - first - 1) % (each + 1)
    return hops * hop + (under_way * every if under_way > 0 else 0.0)


@lean_kernel
def _step_length(size, voxel, other):
    """Distance between the centres of two voxels."""
    x, y, z = grid_index(size, voxel)
    i, j, k = grid_index(size, other)
    return math.sqrt(float((x - i) ** 2 + (y - j) ** 2 + (z - k) ** 2))


@lean_kernel
def combined_bits(belief, scan, gap_probability, scan_poses, at, scratch):
    """Bits that scans at some poses and at a viewpoint should take from the robot's map together.

    Args:
        belief: A Belief.
        scan: A ScanModel.
        gap_probability: As in `imagined_bits`.
        scan_poses: (N, 5) of the scans on the path.
        at: (5,) the viewpoint.
        scratch: A ScanScratch, in which what is left to teammates is marked.
    """
    count = 0
    for number in range(len(scan_poses)):
        count = imagine_scan(belief, scan, gap_probability, scan_poses[number], scratch, count)
    count = imagine_scan(belief, scan, gap_probability, at, scratch, count)
    return gathered_bits(belief, scratch, count)
