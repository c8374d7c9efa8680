"""Lookouts: places from which what is unknown around a frontier cell is in sight.

A voxel is in sight of a place if the straight line between their centres leads through known free space up
to the voxel's face. Grid units; voxels by number, C order.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.raycast import OPEN, Line, cast_range
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.frontiers.voxel_map import (
    DROPPED,
    EDGE,
    NONE,
    UNEXPLORED,
    FrontierMap,
    shares_face,
)

_KNOWN_FREE = 1
"""States above this are unmapped or covered."""
_SHORT = 1e-6
"""So much before the face of the voxel that is looked at a line ends, in voxel edges."""


@lean_kernel
def collect_unseen(frontiers: FrontierMap, voxel: int, radius: int, found: np.ndarray) -> int:
    """Fill in the unexplored voxels around a voxel that lie beside an edge, or are one.

    Args:
        frontiers: Of the robot.
        voxel: In the middle; of planar robots in their layer.
        radius: Voxels that others may be off along any axis.
        found: (≥ (2 radius + 1)^3,) int32; in one layer (2 radius + 1)^2 are enough.

    Returns:
        How many there are.
    """
    size, state, flags, count = frontiers.size, frontiers.state, frontiers.flags, 0
    x, y, z = grid_index(size, voxel)
    deep = 0 if frontiers.layer >= 0 else radius
    for i in range(max(x - radius, 0), min(x + radius, size[0] - 1) + 1):
        for j in range(max(y - radius, 0), min(y + radius, size[1] - 1) + 1):
            for k in range(max(z - deep, 0), min(z + deep, size[2] - 1) + 1):
                near = flat_index(size, i, j, k)
                edge = flags[near] & (EDGE | DROPPED) == EDGE
                if state[near] & UNEXPLORED and (
                    edge or shares_face(frontiers, flags, EDGE | DROPPED, EDGE, i, j, k)
                ):
                    found[count] = near
                    count += 1
    return count


@lean_kernel
def collect_standing(frontiers: FrontierMap, voxel: int, radius: float, found: np.ndarray) -> int:
    """Fill in the voxels within a radius of a voxel in which the body may stand.

    Args:
        frontiers: Of the robot.
        voxel: In the middle.
        radius: In voxel edges.
        found: (≥ (2 radius + 1)^3,) int32; in one layer (2 radius + 1)^2 are enough.

    Returns:
        How many there are.
    """
    size, count, wide = frontiers.size, 0, int(radius)
    x, y, z = grid_index(size, voxel)
    for i in range(max(x - wide, 0), min(x + wide, size[0] - 1) + 1):
        for j in range(max(y - wide, 0), min(y + wide, size[1] - 1) + 1):
            for k in range(max(z - wide, 0), min(z + wide, size[2] - 1) + 1):
                near = flat_index(size, i, j, k)
                apart = (i - x) * (i - x) + (j - y) * (j - y) + (k - z) * (k - z)
                if apart <= radius * radius and not math.isinf(frontiers.traversal_cost[near]):
                    found[count] = near
                    count += 1
    return count


@lean_kernel
def first_lookout(frontiers: FrontierMap, places: np.ndarray, unseen: np.ndarray, reach: float) -> int:
    """The first of some places that has all of some voxels in sight.

    Args:
        frontiers: Of the robot.
        places: (K,) int32 voxels.
        unseen: (N,) int32 voxels; if there are none, no place has them in sight.
        reach: From how far off at most a voxel is in sight, in voxel edges.

    Returns:
        Its index among the places; NONE = none has.
    """
    if len(unseen) == 0:
        return NONE
    for number in range(len(places)):
        all_seen = True
        for voxel in unseen:
            all_seen = all_seen and in_sight(frontiers, places[number], voxel, reach)
        if all_seen:
            return number
    return NONE


@lean_kernel
def in_sight(frontiers: FrontierMap, place: int, voxel: int, reach: float) -> bool:
    """Whether a voxel is in sight of a place, at most `reach` voxel edges off."""
    a, b = grid_index(frontiers.size, place), grid_index(frontiers.size, voxel)
    x, y, z = float(b[0] - a[0]), float(b[1] - a[1]), float(b[2] - a[2])
    length = math.sqrt(x * x + y * y + z * z)
    if length > reach:
        return False
    until = length - 0.5 * length / max(abs(x), abs(y), abs(z), 1.0) - _SHORT  # where it enters the voxel
    if until <= 0.0:
        return True
    start, direction = (a[0] + 0.5, a[1] + 0.5, a[2] + 0.5), (x / length, y / length, z / length)
    _, _, end = cast_range(frontiers.state, frontiers.size, Line(start, direction, until), _KNOWN_FREE)
    return end == OPEN
