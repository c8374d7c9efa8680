"""Voxels crossed by a ray: exact traversal in grid units (Amanatides & Woo 1987).

Grid units: voxel (i, j, k) is the cube [i, i+1) × [j, j+1) × [k, k+1); lengths are in voxel edges.
Voxels are numbered in C order, z fastest.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

OPEN = 0
"""The ray reached its length without meeting anything."""
OBSTACLE = 1
"""The ray met a covered voxel."""
WALL = 2
"""The ray met the boundary of the workspace."""

STOP_AT_COVERED = 0.5
"""Rays stop in front of voxels with more coverage than this: in the truth and in beliefs alike."""
NEVER_STOP = 2.0
"""No coverage is above this: the ray goes its whole length."""


@njit(cache=True, nogil=True, error_model="numpy")
def longest_crossing(size_x, size_y, size_z, length, voxels_behind):
    """Most voxels that a ray can cross: the scratch space that `cast_ray` needs.

    Args:
        size_x: Voxels of the workspace along x.
        size_y: Along y.
        size_z: Along z.
        length: Longest ray in voxel edges; inf allowed.
        voxels_behind: Voxels crossed behind the end.
    """
    within = size_x + size_y + size_z
    if length < within:
        within = min(within, math.ceil(length * 1.7320508075688772) + 4)
    return within + voxels_behind + 1


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _axis(position, direction, size):
    """Start of the traversal along one axis.

    Returns:
        Voxel index, step (-1, 0, 1), steps left inside, distance to the first face and between faces.
    """
    index = min(max(int(position), 0), size - 1)  # inside: no need to call floor, which is slow
    if direction > 0.0:
        gap = 1.0 / direction
        return index, 1, size - 1 - index, (index + 1 - position) * gap, gap
    if direction < 0.0:
        gap = -1.0 / direction
        return index, -1, index, (position - index) * gap, gap
    return index, 0, 0, math.inf, math.inf


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _next_voxel(
    voxel, step_x, left_x, face_x, gap_x, step_y, left_y, face_y, gap_y, step_z, left_z, face_z, gap_z
):
    """Cross the nearest face, x before y before z where the ray meets an edge."""
    if face_z < min(face_x, face_y):
        return face_z, voxel + step_z, left_x, face_x, left_y, face_y, left_z - 1, face_z + gap_z
    if face_x <= face_y:
        return face_x, voxel + step_x, left_x - 1, face_x + gap_x, left_y, face_y, left_z, face_z
    return face_y, voxel + step_y, left_x, face_x, left_y - 1, face_y + gap_y, left_z, face_z


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def cast_ray(coverage, stop_above, size, start, direction, length, hit_at_length, behind, crossed, entered):
    """Walk along a ray, and note the voxels that it crosses, until something ends it.

    The ray ends at the face of the first voxel whose coverage is above `stop_above` (the voxel that
    it starts in never stops it), at the boundary of the workspace, or after `length`. Where it ends
    at an obstacle (a covered voxel, or its length if `hit_at_length`), the next `behind` voxels on
    its line are noted, too.

    Args:
        coverage: (V,) float32, the truth or a belief's mean.
        stop_above: Coverage that stops the ray; NEVER_STOP to fuse a measurement that is known.
        size: (X, Y, Z) voxels.
        start: (3,) float64 start in grid units, inside the workspace.
        direction: (3,) float64 unit vector.
        length: Longest way in voxel edges, > 0; inf allowed.
        hit_at_length: Whether the ray's length is a measured hit rather than the end of its range.
        behind: Voxels to note behind an obstacle.
        crossed: (L,) int32, filled with the crossed voxels in order (see `longest_crossing`).
        entered: (L,) float64, filled with the distance at which each was entered (the end, behind it).

    Returns:
        (length, n, end): distance to the end in voxel edges, number of crossed voxels, and OPEN,
        OBSTACLE or WALL.
    """
    size_x, size_y, size_z = size
    ix, step_x, left_x, face_x, gap_x = _axis(start[0], direction[0], size_x)
    iy, step_y, left_y, face_y, gap_y = _axis(start[1], direction[1], size_y)
    iz, step_z, left_z, face_z, gap_z = _axis(start[2], direction[2], size_z)
    voxel = (ix * size_y + iy) * size_z + iz
    step_x *= size_y * size_z
    step_y *= size_z
    at, n, end = 0.0, 0, WALL
    while at < length:
        if coverage[np.uint64(voxel)] > stop_above and n > 0:
            end = OBSTACLE
            break
        crossed[n] = voxel
        entered[n] = at
        n += 1
        at, voxel, left_x, face_x, left_y, face_y, left_z, face_z = _next_voxel(
            voxel, step_x, left_x, face_x, gap_x, step_y, left_y, face_y, gap_y, step_z, left_z, face_z, gap_z
        )
        if left_x < 0 or left_y < 0 or left_z < 0:
            break
    if end != OBSTACLE and at >= length:
        at, end = length, OBSTACLE if hit_at_length else OPEN
    if end == OBSTACLE:
        for _ in range(behind):
            if min(left_x, left_y, left_z) < 0:
                break
            crossed[n] = voxel
            entered[n] = at
            n += 1
            _, voxel, left_x, face_x, left_y, face_y, left_z, face_z = _next_voxel(
                voxel,
                step_x,
                left_x,
                face_x,
                gap_x,
                step_y,
                left_y,
                face_y,
                gap_y,
                step_z,
                left_z,
                face_z,
                gap_z,
            )
    return at, n, end
