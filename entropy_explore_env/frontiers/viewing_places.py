"""Viewing places: where voxels are visible from, by lines between centres through known free space."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.raycast import OPEN, Line, cast_range
from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.frontiers.blocks import NONE, Blocks

_KNOWN_FREE = 1
"""States above this are unmapped or covered."""
_SHORT = 1e-6
"""Voxel edges by which a line ends before the face of the voxel that is looked at."""


@lean_kernel
def first_viewing_place(blocks: Blocks, places: np.ndarray, voxels: np.ndarray, reach: float) -> int:
    """Return the index of the first of some places from which all of some voxels are visible; NONE = none.

    Args:
        blocks: Voxels of the robot, in blocks.
        places: (K,) int32 voxels.
        voxels: (N,) int32; if there are none, they are visible from no place.
        reach: How far off a voxel is visible at most, in voxel edges.
    """
    for number in range(len(places)):
        all_visible = len(voxels) > 0
        for voxel in voxels:
            all_visible = all_visible and is_visible(blocks, places[number], voxel, reach)
        if all_visible:
            return number
    return NONE


@lean_kernel
def is_visible(blocks: Blocks, place: int, voxel: int, reach: float) -> bool:
    """Whether a voxel is visible from a place, at most `reach` voxel edges off, up to the voxel's face."""
    a, b = grid_index(blocks.size, place), grid_index(blocks.size, voxel)
    x, y, z = float(b[0] - a[0]), float(b[1] - a[1]), float(b[2] - a[2])
    length = math.sqrt(x * x + y * y + z * z)
    if length > reach:
        return False
    until = length - 0.5 * length / max(abs(x), abs(y), abs(z), 1.0) - _SHORT  # where it enters the voxel
    if until <= 0.0:
        return True
    start, direction = (a[0] + 0.5, a[1] + 0.5, a[2] + 0.5), (x / length, y / length, z / length)
    _, _, end = cast_range(blocks.state, blocks.size, Line(start, direction, until), _KNOWN_FREE)
    return end == OPEN
