"""Voxels crossed by a ray: exact traversal in grid units (Amanatides & Woo 1987).

Grid units: voxel (i, j, k) is the cube [i, i+1) × [j, j+1) × [k, k+1); lengths are in voxel edges.
Voxels are numbered in C order, z fastest. Along a ray, distances are whole numbers of ticks: sums of
whole numbers are exact, and the processor compares and selects them without a branch.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.voxel_index import flat_index
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

OPEN_END = np.bool_(False)
"""A ray's length is the end of its range, no measured hit. A NumPy value, like the next two, so that
`cast_ray` compiles for one type."""
NONE_BEHIND, ONE_BEHIND = np.int64(0), np.int64(1)
"""Voxels to note behind an obstacle."""

TICKS = 2.0**40
"""Ticks in a voxel edge: the resolution of distances along a ray."""
_EDGES = 1.0 / TICKS
_FAR = 2.0**21
"""Longer than any workspace, in voxel edges: the distance of a face that no ray reaches."""
_FAR_TICKS = 2**61


class Line(NamedTuple):
    """A straight line in grid units; plain numbers, so that `cast_ray` compiles for one type."""

    start: tuple[float, float, float]
    direction: tuple[float, float, float]
    """Unit vector."""
    length: float
    """Voxel edges, > 0; inf allowed."""


class Crossing(NamedTuple):
    """Scratch space of `cast_ray` for L voxels: see `longest_crossing`."""

    voxels: np.ndarray
    """(L,) int32, the crossed voxels in order."""
    entered: np.ndarray
    """(L,) int64, the ticks at which each was entered."""


class RayEnd(NamedTuple):
    """Where a ray ended."""

    length: float
    """Distance to the end in voxel edges."""
    voxels: int
    """Number of crossed voxels."""
    reason: int
    """OPEN, OBSTACLE or WALL."""


class _Axes(NamedTuple):
    """A whole number for each axis."""

    x: int
    y: int
    z: int


class _AxisStart(NamedTuple):
    """Start of the traversal along one axis."""

    index: int
    """Of the voxel."""
    step: int
    """-1, 0 or 1."""
    face: int
    """Ticks to the first face."""
    gap: int
    """Ticks between faces."""
    last: int
    """Ticks to the workspace's boundary."""


@inlined_kernel
def point(array):
    """Return (x, y, z), the first three numbers of an array, as a tuple."""
    return array[0], array[1], array[2]


@inlined_kernel
def distance_between(a, b):
    """Return the distance between two points (x, y, z)."""
    return math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)


@lean_kernel
def longest_crossing(size_x, size_y, size_z, length, voxels_behind):
    """Return the most voxels that a ray can cross: the scratch space that `cast_ray` needs.

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
    """Return the _AxisStart of a ray at `position` with a component `direction`, among `size` voxels."""
    index = min(max(int(position), 0), size - 1)  # inside: no need to call floor, which is slow
    if direction == 0.0:
        return _AxisStart(index, 0, _FAR_TICKS, _FAR_TICKS, _FAR_TICKS)
    ahead = direction > 0.0
    edge = 1.0 / abs(direction)
    face = _ticks((index + 1 - position if ahead else position - index) * edge)
    gap = _ticks(edge)
    left = size - 1 - index if ahead else index
    last = face + left * gap if left * edge < _FAR else _FAR_TICKS
    return _AxisStart(index, 1 if ahead else -1, face, gap, last)


@inlined_kernel
def _ticks(length):
    """Return a distance in voxel edges as a whole number of ticks."""
    return int(min(length, _FAR) * TICKS + 0.5)


@inlined_kernel
def _next_voxel(voxel, steps, faces, gaps):
    """Cross the nearest face, x before y before z where the ray meets an edge.

    Selects only, no branches: which face comes next cannot be predicted, and a misprediction costs more.

    Args:
        voxel: Number of the present voxel.
        steps: _Axes, what a step along each axis adds to it.
        faces: _Axes, ticks to the next face of each axis.
        gaps: _Axes, ticks between faces.

    Returns:
        (voxel, ticks, faces): the next voxel, the ticks at which it is entered, and the next faces.
    """
    by_x = faces.x <= faces.y
    nearest = faces.x if by_x else faces.y
    by_z = faces.z < nearest
    step = steps.x if by_x else steps.y
    return (
        voxel + (steps.z if by_z else step),
        faces.z if by_z else nearest,
        _Axes(
            faces.x + (gaps.x if by_x & (not by_z) else 0),
            faces.y + (gaps.y if (not by_x) & (not by_z) else 0),
            faces.z + (gaps.z if by_z else 0),
        ),
    )


@inlined_kernel
def cast_ray(coverage, size, line, stop_above, hit_at_length, behind, crossing):
    """Walk along a line, and note the voxels that it crosses, until something ends it.

    The ray ends at the face of the first voxel whose coverage is above `stop_above` (the voxel that
    it starts in never stops it), at the boundary of the workspace, or at the line's length. Where it ends
    at an obstacle (a covered voxel, or its length if `hit_at_length`), the next `behind` voxels on
    its line are noted, too.

    Args:
        stop_above: Coverage that stops the ray; NEVER_STOP to trace a measurement that is known.
        hit_at_length: Whether the ray's length is a measured hit rather than the end of its range.
        behind: Voxels to note behind an obstacle.
        crossing: Crossing, filled with the crossed voxels; those behind the end are entered at its ticks.

    Returns:
        RayEnd.
    """
    crossed, entered = crossing.voxels, crossing.entered
    x = _axis(line.start[0], line.direction[0], size[0])
    y = _axis(line.start[1], line.direction[1], size[1])
    z = _axis(line.start[2], line.direction[2], size[2])
    voxel = flat_index(size, x.index, y.index, z.index)
    steps = _Axes(x.step * (size[1] * size[2]), y.step * size[2], z.step)
    faces, gaps = _Axes(x.face, y.face, z.face), _Axes(x.gap, y.gap, z.gap)
    leaves = min(x.last, y.last, z.last)
    stops = _ticks(line.length)
    until = min(leaves, stops)
    crossed[0], entered[0] = voxel, 0
    n, end = 1, WALL
    while True:
        voxel, at, faces = _next_voxel(voxel, steps, faces, gaps)
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
        reached, end = line.length, OBSTACLE if hit_at_length else OPEN
    if end == OBSTACLE:
        for _ in range(behind):
            if at >= leaves:
                break
            crossed[np.uint32(n)] = voxel
            entered[np.uint32(n)] = ends
            n += 1
            voxel, at, faces = _next_voxel(voxel, steps, faces, gaps)
    return RayEnd(reached, n, end)


@inlined_kernel
def cast_range(coverage, size, line, stop_above):
    """Walk along a line until something ends it, as `cast_ray` does, but note no voxels.

    Args:
        stop_above: Coverage that stops the ray.

    Returns:
        (length, covered, reason): that of `cast_ray`, the coverage of the voxel that the ray met, 0 if it met
        none, and OPEN, OBSTACLE or WALL.
    """
    x = _axis(line.start[0], line.direction[0], size[0])
    y = _axis(line.start[1], line.direction[1], size[1])
    z = _axis(line.start[2], line.direction[2], size[2])
    voxel = flat_index(size, x.index, y.index, z.index)
    steps = _Axes(x.step * (size[1] * size[2]), y.step * size[2], z.step)
    faces, gaps = _Axes(x.face, y.face, z.face), _Axes(x.gap, y.gap, z.gap)
    stops = _ticks(line.length)
    until = min(min(x.last, y.last, z.last), stops)
    while True:
        voxel, at, faces = _next_voxel(voxel, steps, faces, gaps)
        if at >= until:
            break
        covered = coverage[np.uint64(voxel)]
        if covered > stop_above:
            return at * _EDGES, covered, OBSTACLE
    if at >= stops:
        return line.length, np.float32(0.0), OPEN
    return at * _EDGES, np.float32(0.0), WALL
