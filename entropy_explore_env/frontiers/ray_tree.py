"""Rays of all directions from the centre of a voxel, merged where they cross the same voxels.

From every voxel's centre the rays cross the same pattern of voxels. Rays that lie close to each other start
with the same voxels. As branches of a tree, what they share is traversed once, and where something stops a
branch all its rays end. Nodes are in depth-first order. Grid units.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import (
    NONE_BEHIND,
    OPEN_END,
    Crossing,
    Line,
    cast_ray,
    longest_crossing,
)
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.settings import RobotKind

MOST_RAYS = 720
_ROWS = 15
"""Rows of imagined rays for robots that look up and down."""


class RayTree(NamedTuple):
    """N voxels that rays cross, as steps from the voxel they start in, which is the first."""

    steps: np.ndarray
    """(N, 3) int32, along the axes."""
    offset: np.ndarray
    """(N,) int64, the same as a difference of voxel numbers."""
    cell: np.ndarray
    """(N,) uint32, number of the voxel among those that the tree's rays cross; several nodes may have one."""
    after: np.ndarray
    """(N,) uint32, the next node if this one stops its rays."""
    cells: int
    """Number of different voxels C."""
    box: np.ndarray
    """(C,) int64, their numbers in a box that extends `margin` to all sides of the first voxel; ascending."""
    margin: tuple[int, int, int]
    """See `box`."""
    nodes: np.ndarray
    """(N,) uint32, nodes in the order of their cells."""
    first: np.ndarray
    """(C + 1,) int64, index in `nodes` of each cell's first node, and one past the last cell's last."""
    low: tuple[int, int, int]
    """Smallest steps along the axes."""
    high: tuple[int, int, int]
    """Largest steps along the axes. Where all voxels between lie inside, no ray leaves the workspace."""


def imagined_pitches(kind: RobotKind, flies: bool) -> np.ndarray:
    """Return (rows,) pitches of imagined rays: all of them for flying robots, else the sensor's."""
    tilt = kind.sensor.field_of_view_rad[1]
    if flies:
        return (np.arange(_ROWS) + 0.5) * (math.pi / _ROWS) - math.pi / 2
    rows = min(kind.sensor.rows, _ROWS)
    return np.linspace(-tilt / 2, tilt / 2, rows) if rows > 1 else np.zeros(1)


def rays_around(reach: float, pitches: np.ndarray) -> np.ndarray:
    """Return (D, 3) float64 unit vectors all around: in plans one for every voxel edge at `reach`.

    Args:
        reach: In voxel edges; there are MOST_RAYS at most.
        pitches: (rows,) radians downwards; with more than one row at most 32 to a turn.
    """
    turns = min(math.ceil(2.0 * math.pi * min(reach, 1e4)), MOST_RAYS if len(pitches) == 1 else 32)
    return rays_towards((np.arange(turns) + 0.5) * (2.0 * math.pi / turns), pitches)


def rays_towards(yaws: np.ndarray, pitches: np.ndarray) -> np.ndarray:
    """Return (D, 3) float64 unit vectors of all pairs of yaw and pitch, radians."""
    yaw, pitch = (axis.reshape(-1) for axis in np.meshgrid(yaws, pitches, indexing="ij"))
    level = np.cos(pitch)
    return np.stack([np.cos(yaw) * level, np.sin(yaw) * level, -np.sin(pitch)], axis=-1)


def grow_tree(directions: np.ndarray, reach: float, size: tuple[int, int, int]) -> RayTree:
    """Return the tree of the voxels that rays cross where nothing stops them.

    Args:
        directions: (D, 3) float64 unit vectors, D ≥ 1.
        reach: In voxel edges; inf allowed.
        size: (X, Y, Z) voxels of the workspace.
    """
    wide = math.ceil(min(reach, sum(size))) + 1
    margin = np.minimum(np.array(size) - 1, wide)
    box = 2 * margin + 1
    shape = (int(box[0]), int(box[1]), int(box[2]))
    voxels = np.full((len(directions), longest_crossing(*shape, reach, 0)), -1)
    empty = np.broadcast_to(np.zeros(1, np.uint8), (math.prod(shape),))
    scratch = np.empty(voxels.shape[1], np.int32), np.empty(voxels.shape[1], np.int64)
    _walk(empty, shape, margin + 0.5, np.ascontiguousarray(directions), float(reach), *scratch, voxels)
    voxels = voxels[np.lexsort(voxels.T[::-1])]
    new = np.ones(voxels.shape, bool)
    new[1:] = np.logical_or.accumulate(voxels[1:] != voxels[:-1], axis=1)
    new &= voxels >= 0
    _, depth = np.nonzero(new)
    steps = np.stack(np.unravel_index(voxels[new], shape), axis=-1) - margin
    low, high = steps.min(0).tolist(), steps.max(0).tolist()
    offset = steps @ np.array([size[1] * size[2], size[2], 1])
    after = np.full(len(depth), len(depth))
    _find_next(depth, np.empty_like(depth), after)
    cells, cell = np.unique(voxels[new], return_inverse=True)
    return RayTree(
        steps.astype(np.int32),
        offset,
        cell.astype(np.uint32),
        after.astype(np.uint32),
        cells=len(cells),
        box=cells.astype(np.int64),
        margin=(int(margin[0]), int(margin[1]), int(margin[2])),
        nodes=np.argsort(cell, kind="stable").astype(np.uint32),
        first=np.concatenate([[0], np.cumsum(np.bincount(cell))]).astype(np.int64),
        low=tuple(low),
        high=tuple(high),
    )


@inlined_kernel
def cell_at(tree, x, y, z):
    """Return the number of the cell at a step from the first voxel; -1 = no ray crosses it."""
    margin = tree.margin
    if abs(x) > margin[0] or abs(y) > margin[1] or abs(z) > margin[2]:
        return -1
    wide, high = 2 * margin[1] + 1, 2 * margin[2] + 1
    number = ((x + margin[0]) * wide + y + margin[1]) * high + z + margin[2]
    cell = np.searchsorted(tree.box, number)
    return cell if cell < len(tree.box) and tree.box[cell] == number else -1


@lean_kernel
def _walk(empty, size, start, directions, reach, crossed, entered, voxels):
    """Fill (D, L) with the voxels that each ray crosses in an empty box."""
    begin = (start[0], start[1], start[2])
    for ray in range(len(directions)):
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        line, crossing = Line(begin, direction, reach), Crossing(crossed, entered)
        _, n, _ = cast_ray(empty, size, line, 1, OPEN_END, NONE_BEHIND, crossing)
        for place in range(n):
            voxels[ray, place] = crossed[place]


@lean_kernel
def _find_next(depth, branch, after):
    """Fill (N,) with the next node that is not deeper, where there is one; `branch` is scratch space."""
    count = 0
    for node in range(len(depth)):
        while count > 0 and depth[branch[count - 1]] >= depth[node]:
            count -= 1
            after[branch[count]] = node
        branch[count] = node
        count += 1
