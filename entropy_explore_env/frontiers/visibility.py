"""How many unexplored points are expected to be seen from a place: the V of Sawhney 2009, sects. 3.4-3.5.

In a map of voxels rays go out until something believed covered stops them, or to the sensor's range; each
unexplored voxel that they cross counts once. Over a height field (`terrain_visibility`) points are columns.
A point that n robots have promised to see has the weight 1/(1 + n). (The paper's 1/n would not reduce the
weight for the first promise.) The naive V, for comparison, counts all unexplored points in a ball whose
radius is the range.

Counts are pairs: the number of points, and the sum of their weights. Grid units. In all functions `counter`
is a VisibilityCounter, `state` the (V,) uint8 states of voxels, `size` the voxels along each axis, and
`marking` whether one more robot promises to see the points.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import (
    ONE_BEHIND,
    OPEN_END,
    Crossing,
    Line,
    cast_ray,
    longest_crossing,
)
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.frontiers.voxel_states import UNEXPLORED
from entropy_explore_env.robots.rotations import directions_of
from entropy_explore_env.settings.robot_kind import RobotKind

_MOST_RAYS = 720
_ROWS = 15
"""Rows of imagined rays for robots that look up and down."""
_STOPS_RAYS = 3
"""States above this do."""
_WEIGHTS = 1.0 / (1.0 + np.arange(256))
"""Weights of points by number of promises."""


class VisibilityCounter(NamedTuple):
    """Which of N points the latest count met, and how many robots promised to see each."""

    stamp: np.ndarray
    """(N,) int32, number of the latest count that met a point."""
    promised: np.ndarray
    """(N,) uint8, number of robots that will see a point."""
    latest: np.ndarray
    """(1,) int64, number of the latest count."""
    crossing: Crossing
    """Scratch space of `cast_ray`."""


def new_counter(points: int, shape: tuple[int, int, int]) -> VisibilityCounter:
    """Return a counter for a map of this shape, without promises."""
    longest = longest_crossing(*shape, math.inf, 2)
    crossing = Crossing(np.zeros(longest, np.int32), np.zeros(longest, np.int64))
    return VisibilityCounter(
        np.zeros(points, np.int32),
        np.zeros(points, np.uint8),
        np.zeros(1, np.int64),
        crossing,
    )


@inlined_kernel
def start_count(counter):
    """Start a new count; return its number."""
    counter.latest[0] += 1
    if counter.latest[0] > 2**31 - 2:  # once in a lifetime
        counter.stamp[:] = 0
        counter.latest[0] = 1
    return np.int32(counter.latest[0])


@inlined_kernel
def count_point(counter, point, marking):
    """Return the weight of a visible point."""
    promises = np.int64(counter.promised[point])
    if marking:
        counter.promised[point] = min(promises + 1, 255)
    return _WEIGHTS[promises]


@lean_kernel
def count_crossed(counter, state, size, start, directions, reach, marking):
    """Count the unexplored voxels that rays from a place (x, y, z) cross.

    The rays go along (D, 3) float64 unit vectors, up to `reach` voxel edges far; inf allowed.
    """
    number, points, weighed = start_count(counter), 0, 0.0
    for ray in range(len(directions)):
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        line = Line(start, direction, reach)
        _, n, _ = cast_ray(state, size, line, _STOPS_RAYS, OPEN_END, ONE_BEHIND, counter.crossing)
        for place in range(n):
            voxel = np.uint32(counter.crossing.voxels[place])
            if state[voxel] & UNEXPLORED and counter.stamp[voxel] != number:
                counter.stamp[voxel] = number
                points += 1
                weighed += count_point(counter, voxel, marking)
    return points, weighed


@lean_kernel
def count_in_ball(counter, state, size, start, reach, marking):
    """Count the naive V as `count_crossed` does: voxels with centres within reach of a place, seen or not."""
    points, weighed = 0, 0.0
    for x in range(max(int(start[0] - reach - 0.5), 0), min(int(start[0] + reach + 1.0), size[0])):
        for y in range(max(int(start[1] - reach - 0.5), 0), min(int(start[1] + reach + 1.0), size[1])):
            for z in range(max(int(start[2] - reach - 0.5), 0), min(int(start[2] + reach + 1.0), size[2])):
                dx, dy, dz = x + 0.5 - start[0], y + 0.5 - start[1], z + 0.5 - start[2]
                voxel = flat_index(size, x, y, z)
                if dx * dx + dy * dy + dz * dz <= reach * reach and state[voxel] & UNEXPLORED:
                    points += 1
                    weighed += count_point(counter, voxel, marking)
    return points, weighed


@lean_kernel
def count_from(counter, state, size, voxels, directions, reach, seen, weighed):
    """Count from the centres of (K,) int32 voxels what `count_crossed` finds there.

    (K,) `seen` and `weighed` are filled in with the numbers of points and the sums of weights.
    """
    for place in range(len(voxels)):
        x, y, z = grid_index(size, voxels[place])
        start = (x + 0.5, y + 0.5, z + 0.5)
        seen[place], weighed[place] = count_crossed(counter, state, size, start, directions, reach, False)


@lean_kernel
def forget_in_range(size, opened, voxels, sight, bounds):
    """Set the (V,) bounds of (K,) int32 voxels in sight of (N,) int32 opened ones to inf.

    `sight` is a radius in voxel edges, and the weight of distances along z, 0 or 1.
    """
    radius, upright = sight
    for voxel in voxels:
        at = grid_index(size, voxel)
        for other in opened:
            x, y, z = grid_index(size, other)
            dx, dy, dz = x - at[0], y - at[1], (z - at[2]) * upright
            if dx * dx + dy * dy + dz * dz <= radius * radius:
                bounds[voxel] = math.inf
                break


def imagined_pitches(kind: RobotKind, flies: bool) -> np.ndarray:
    """Return (rows,) pitches of imagined rays: all of them for flying robots, else the sensor's."""
    tilt = kind.sensor.field_of_view_rad[1]
    if flies:
        return (np.arange(_ROWS) + 0.5) * (math.pi / _ROWS) - math.pi / 2
    rows = min(kind.sensor.rows, _ROWS)
    return np.linspace(-tilt / 2, tilt / 2, rows) if rows > 1 else np.zeros(1)


def yaws_around(reach: float, most: int = _MOST_RAYS) -> np.ndarray:
    """Return (D,) yaws all around, one for every voxel edge at `reach`, at most `most`."""
    turns = min(math.ceil(2.0 * math.pi * min(reach, 1e4)), most)
    return (np.arange(turns) + 0.5) * (2.0 * math.pi / turns)


def rays_around(reach: float, pitches: np.ndarray) -> np.ndarray:
    """Return (D, 3) float64 unit vectors all around; with more than one pitch at most 32 to a turn."""
    return rays_towards(yaws_around(reach, _MOST_RAYS if len(pitches) == 1 else 32), pitches)


def rays_towards(yaws: np.ndarray, pitches: np.ndarray) -> np.ndarray:
    """Return (…, D, 3) float64 unit vectors of all pairs of (…, N) yaws and (…, M) pitches, radians."""
    rays = directions_of(yaws[..., :, np.newaxis], pitches[..., np.newaxis, :])
    return rays.reshape(*rays.shape[:-3], -1, 3)
