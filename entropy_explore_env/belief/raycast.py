"""Voxels crossed by a ray: exact traversal in grid units (Amanatides & Woo 1987).

Grid units: voxel (i, j, k) is the cube [i, i+1) × [j, j+1) × [k, k+1); lengths are in voxel edges.
Voxels are numbered in C order, z fastest. Along a ray, distances are whole numbers of ticks: sums of
whole numbers are exact, and the processor compares and selects them without a guess.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

OPEN = 0
"""The ray reached its length without meeting anything."""
OBSTACLE = 1
"""The ray met a covered voxel."""
WALL = 2
"""The ray met the boundary of the workspace."""

STOP_AT_COVERED = 0.5
"""Rays stop in front of voxels with more coverage than this: in the truth and in beliefs alike."""
NEVER_STOP = math.inf
"""No coverage is above this: the ray goes its whole length."""

TICKS = 2.0**40
"""Ticks in a voxel edge: the resolution of distances along a ray."""
_EDGES = 1.0 / TICKS
_FAR = 2.0**21
"""Farther than any workspace is long, in voxel edges: a face that no ray reaches."""
_FAR_TICKS = 2**61


@lean_kernel
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


@inlined_kernel
def _axis(position, direction, size):
    """Start of the traversal along one axis.

    Returns:
        Voxel index, step (-1, 0, 1), ticks to the first face, between faces, and to the last face.
    """
    index = min(max(int(position), 0), size - 1)  # inside: no need to call floor, which is slow
    if direction == 0.0:
        return index, 0, _FAR_TICKS, _FAR_TICKS, _FAR_TICKS
    ahead = direction > 0.0
    edge = 1.0 / abs(direction)
    face = _ticks((index + 1 - position if ahead else position - index) * edge)
    gap = _ticks(edge)
    left = size - 1 - index if ahead else index
    last = face + left * gap if left * edge < _FAR else _FAR_TICKS
    return index, 1 if ahead else -1, face, gap, last


@inlined_kernel
def _ticks(length):
    """A distance in voxel edges as a whole number of ticks."""
    return int(min(length, _FAR) * TICKS + 0.5)


@inlined_kernel
def _next_voxel(voxel, step_x, face_x, gap_x, step_y, face_y, gap_y, step_z, face_z, gap_z):
    """Cross the nearest face, x before y before z where the ray meets an edge.

    Nothing but selects: which face comes next is as good as random, and a wrong guess costs more.
    """
    by_x = face_x <= face_y
    nearest = face_x if by_x else face_y
    by_z = face_z < nearest
    step = step_x if by_x else step_y
    return (
        voxel + (step_z if by_z else step),
        face_z if by_z else nearest,
        face_x + (gap_x if by_x & (not by_z) else 0),
        face_y + (gap_y if (not by_x) & (not by_z) else 0),
        face_z + (gap_z if by_z else 0),
    )


@inlined_kernel
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
        start: (x, y, z) in grid units, inside the workspace.
        direction: (3,) float64 unit vector.
        length: Longest way in voxel edges, > 0; inf allowed.
        hit_at_length: Whether the ray's length is a measured hit rather than the end of its range.
        behind: Voxels to note behind an obstacle.
        crossed: (L,) int32, filled with the crossed voxels in order (see `longest_crossing`).
        entered: (L,) int64, filled with the ticks at which each was entered (those of the end, behind it).

    Returns:
        (length, n, end): distance to the end in voxel edges, number of crossed voxels, and OPEN,
        OBSTACLE or WALL.
    """
    size_x, size_y, size_z = size
    ix, step_x, face_x, gap_x, last_x = _axis(start[0], direction[0], size_x)
    iy, step_y, face_y, gap_y, last_y = _axis(start[1], direction[1], size_y)
    iz, step_z, face_z, gap_z, last_z = _axis(start[2], direction[2], size_z)
    voxel = (ix * size_y + iy) * size_z + iz
    step_x *= size_y * size_z
    step_y *= size_z
    leaves = min(last_x, last_y, last_z)
    stops = _ticks(length)
    until = min(leaves, stops)
    crossed[0], entered[0] = voxel, 0
    n, end = 1, WALL
    while True:
        voxel, at, face_x, face_y, face_z = _next_voxel(
            voxel, step_x, face_x, gap_x, step_y, face_y, gap_y, step_z, face_z, gap_z
        )
        if at >= until:
            break
        if coverage[np.uint64(voxel)] > stop_above:
            end = OBSTACLE
            break
        crossed[np.uint32(n)] = voxel
        entered[np.uint32(n)] = at
        n += 1
    reached, ends = at * _EDGES, min(at, stops)
    if end == WALL and at >= stops:
        reached, end = length, OBSTACLE if hit_at_length else OPEN
    if end == OBSTACLE:
        for _ in range(behind):
            if at >= leaves:
                break
            crossed[np.uint32(n)] = voxel
            entered[np.uint32(n)] = ends
            n += 1
            voxel, at, face_x, face_y, face_z = _next_voxel(
                voxel, step_x, face_x, gap_x, step_y, face_y, gap_y, step_z, face_z, gap_z
            )
    return reached, n, end
