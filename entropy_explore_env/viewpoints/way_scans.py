"""The scans that a robot takes on the way to a viewpoint, and the bits of all of them; grid units."""

from __future__ import annotations

import math

from entropy_explore_env.belief.paths.search import extract_path
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.viewpoints.gathered_bits import gathered_bits
from entropy_explore_env.viewpoints.imagined_scan import imagine_scan
from entropy_explore_env.viewpoints.travel import STRAIGHTENED

_ROUNDING = 1e-6
"""A scan under way so near to a path's end, as a share of the path, is the one that is taken there."""


@lean_kernel
def planned_path(search, lattice, size, at, path):
    """Write down the voxels of the path that the latest search found to a viewpoint (5,).

    Returns:
        How many; 0 = there is none.
    """
    voxel = flat_index(
        size, min(int(at[0]), size[0] - 1), min(int(at[1]), size[1] - 1), min(int(at[2]), size[2] - 1)
    )
    return extract_path(search, lattice, voxel, path)


@lean_kernel
def fill_way_scans(lattice, size, path, count, here, at, every, since, places):
    """Fill in where a robot should scan on the way to a viewpoint, spread evenly over those scans.

    It scans after every `every` voxel edges that it drives. A path leads over the centres of voxels, and is
    driven STRAIGHTENED times their distances; without one the robot drives straight.

    Args:
        lattice: Of the search; where it is one layer, all scans are at the robot's height.
        size: (X, Y, Z) voxels.
        path: (V,) int32, voxels from the robot's to the viewpoint's.
        count: How many; 0 or 1 = straight.
        here: (5,) the robot.
        at: (5,) the viewpoint; its gaze is that of the scans, too.
        every: Voxel edges between two scans; inf = none is taken under way.
        since: Voxel edges that it has driven since its latest scan.
        places: (N, 5), of which the first are filled in.

    Returns:
        How many.
    """
    most = len(places)
    if most == 0 or math.isinf(every):
        return 0
    straight = math.sqrt((at[0] - here[0]) ** 2 + (at[1] - here[1]) ** 2 + (at[2] - here[2]) ** 2)
    length = straight
    if count > 1:
        length = 0.0
        for step in range(1, count):
            length += _step_length(size, path[step - 1], path[step])
        length = max(straight, STRAIGHTENED * length)
    scans = math.ceil((length * (1.0 - _ROUNDING) + since) / every) - 1
    taken = min(max(scans, 0), most)
    passed, step, share = 0.0, 1, 0.0
    for number in range(taken):
        scan = ((number + 1) * scans + taken - 1) // taken
        share = min(max((scan * every - since) / length, 0.0), 1.0)
        place = places[number]
        for axis in range(5):
            place[axis] = at[axis]
        if count > 1:
            whole = length / STRAIGHTENED
            while step < count:
                ahead = _step_length(size, path[step - 1], path[step])
                if passed + 0.5 * ahead > share * whole:
                    break
                passed += ahead
                step += 1
            x, y, z = grid_index(size, path[step - 1])
            place[0], place[1] = x + 0.5, y + 0.5
            place[2] = here[2] if lattice.layer >= 0 else z + 0.5
        else:
            for axis in range(3):
                place[axis] = here[axis] + share * (at[axis] - here[axis])
    return taken


@lean_kernel
def _step_length(size, voxel, other):
    """Distance between the centres of two voxels."""
    x, y, z = grid_index(size, voxel)
    i, j, k = grid_index(size, other)
    return math.sqrt(float((x - i) ** 2 + (y - j) ** 2 + (z - k) ** 2))


@lean_kernel
def way_bits(belief, scan, gap_probability, places, at, scratch):
    """Bits that scans from some places and from a viewpoint should take from the robot's map together.

    Args:
        belief: A Belief.
        scan: A ScanModel.
        gap_probability: As in `imagined_bits`.
        places: (N, 5) of the scans on the way.
        at: (5,) the viewpoint.
        scratch: A ScanScratch, in which what is left to teammates is marked.
    """
    count = 0
    for number in range(len(places)):
        count = imagine_scan(belief, scan, gap_probability, places[number], scratch, count)
    count = imagine_scan(belief, scan, gap_probability, at, scratch, count)
    return gathered_bits(belief, scratch, count)
