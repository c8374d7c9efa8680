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
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.settings.robot_kind import RobotKind

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
    """(N,) uint32, number of the voxel among the C that the tree's rays cross; several nodes may have one."""
    cells: int
    """C."""
    after: np.ndarray
    """(N,) uint32, the next node if this one stops its rays."""
    behind: np.ndarray
    """(2 M_x + 1, 2 M_y + 1, 2 M_z + 1) int32: how many nodes lie in a voxel or behind it, by its steps from
    the first voxel, plus M. No more than these are newly visible where the voxel turns free."""
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


def yaws_around(reach: float, most: int = MOST_RAYS) -> np.ndarray:
    """Return (D,) yaws all around, one for every voxel edge at `reach`, at most `most`."""
    turns = min(math.ceil(2.0 * math.pi * min(reach, 1e4)), most)
    return (np.arange(turns) + 0.5) * (2.0 * math.pi / turns)


def rays_around(reach: float, pitches: np.ndarray) -> np.ndarray:
    """Return (D, 3) float64 unit vectors all around; with more than one pitch at most 32 to a turn."""
    return rays_towards(yaws_around(reach, MOST_RAYS if len(pitches) == 1 else 32), pitches)


def rays_towards(yaws: np.ndarray, pitches: np.ndarray) -> np.ndarray:
    """Return (…, D, 3) float64 unit vectors of all pairs of (…, N) yaws and (…, M) pitches, radians."""
    yaw, pitch = yaws[..., :, np.newaxis], pitches[..., np.newaxis, :]
    level = np.cos(pitch)
    axes = np.broadcast_arrays(np.cos(yaw) * level, np.sin(yaw) * level, -np.sin(pitch))
    rays = np.stack(axes, axis=-1)
    return rays.reshape(*rays.shape[:-3], -1, 3)


def grow_tree(directions: np.ndarray, reach: float, size: tuple[int, int, int]) -> RayTree:
    """Return the tree of the voxels that rays cross where nothing stops them.

    Args:
        directions: (D, 3) float64 unit vectors, D ≥ 1.
        reach: In voxel edges; inf allowed.
        size: (X, Y, Z) voxels of the workspace.
    """
    margin = np.minimum(np.array(size) - 1, math.ceil(min(reach, sum(size))) + 1)
    x, y, z = (2 * margin + 1).tolist()
    voxels = np.full((len(directions), longest_crossing(x, y, z, reach, 0)), -1)
    empty = np.broadcast_to(np.zeros(1, np.uint8), (x * y * z,))
    crossing = Crossing(np.empty(voxels.shape[1], np.int32), np.empty(voxels.shape[1], np.int64))
    _walk(empty, (x, y, z), margin + 0.5, np.ascontiguousarray(directions), float(reach), crossing, voxels)
    voxels = voxels[np.lexsort(voxels.T[::-1])]
    new = np.ones(voxels.shape, bool)
    new[1:] = np.logical_or.accumulate(voxels[1:] != voxels[:-1], axis=1)
    new &= voxels >= 0
    steps = np.stack(np.unravel_index(voxels[new], (x, y, z)), axis=-1) - margin
    after, behind = np.full(len(steps), len(steps)), np.zeros((x, y, z), np.int32)
    depth = np.nonzero(new)[1]
    _find_next(depth, np.empty_like(depth), after)
    np.add.at(behind.reshape(-1), voxels[new], after - np.arange(len(after)))
    cells, cell = np.unique(voxels[new], return_inverse=True)
    return RayTree(
        steps.astype(np.int32),
        steps @ np.array([size[1] * size[2], size[2], 1]),
        cell.astype(np.uint32),
        len(cells),
        after.astype(np.uint32),
        behind,
        low=tuple(steps.min(0).tolist()),
        high=tuple(steps.max(0).tolist()),
    )


@lean_kernel
def _walk(empty, size, start, directions, reach, crossing, voxels):
    """Fill (D, L) with the voxels that each ray crosses in an empty box."""
    for ray in range(len(directions)):
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        line = Line((start[0], start[1], start[2]), direction, reach)
        _, n, _ = cast_ray(empty, size, line, 1, OPEN_END, NONE_BEHIND, crossing)
        for place in range(n):
            voxels[ray, place] = crossing.voxels[place]


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
