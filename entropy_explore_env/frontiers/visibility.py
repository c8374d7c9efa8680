"""How many unexplored points are expected to be seen from a place: the V of Sawhney 2009, sects. 3.4-3.5.

In a map of voxels rays go out until something believed covered stops them, or to the sensor's range; each
unexplored voxel that they cross counts once. Over a height field (`terrain_visibility`) points are columns.
A point that n robots have promised to see has the weight 1/(1 + n). (The paper's 1/n would not reduce the
weight for the first promise.) The naive V, for comparison, counts all unexplored points in a ball whose
radius is the range.

Counts are pairs: the number of points, and the sum of their weights. Grid units. In all functions `counter`
is a VisibilityCounter, `state` the (V,) uint8 states of voxels, `size` the voxels along each axis, `tree` a
RayTree, and `marking` whether one more robot promises to see the points.
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
from entropy_explore_env.frontiers.blocks import NONE, UNEXPLORED

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
    promises: np.ndarray
    """(1,) int64, how many points were promised since the latest release."""
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
        counter.promises[0] += 1
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
def count_from(counter, state, size, voxels, tree, met, seen, weighed):
    """Count from the centres of (K,) int32 voxels what `count_crossed` finds there, with the rays as a tree.

    (K,) `seen` and `weighed` are filled in with the numbers of points and the sums of weights; `met` is (C,)
    int32 scratch space.
    """
    for cell in range(len(met)):
        met[cell] = -1
    promises = counter.promises[0] > 0
    for place in range(len(voxels)):
        at, inside = grid_index(size, voxels[place]), True
        for axis in range(3):
            inside &= at[axis] + tree.low[axis] >= 0 and at[axis] + tree.high[axis] < size[axis]
        start = at, place
        if inside and not promises:
            found = _count_branches(counter, state, size, tree, met, start, True, False)
        elif inside:
            found = _count_branches(counter, state, size, tree, met, start, True, True)
        else:
            found = _count_branches(counter, state, size, tree, met, start, False, True)
        seen[place], weighed[place] = found


@inlined_kernel
def _count_branches(counter, state, size, tree, met, start, inside, promises):
    """Count along the tree's branches from a voxel, the `start`: its indices, and its number in the call.

    With `inside` no ray leaves the workspace, and without `promises` all weights are 1: constants, both of
    which save time.
    """
    at, place = start
    voxel = np.int64(flat_index(size, at[0], at[1], at[2]))
    points, weighed, node = 0, 0.0, np.uint32(0)
    while node < np.uint32(len(tree.after)):
        if not inside:
            x, y, z = at[0] + tree.steps[node, 0], at[1] + tree.steps[node, 1], at[2] + tree.steps[node, 2]
            if not (0 <= x < size[0] and 0 <= y < size[1] and 0 <= z < size[2]):
                node = tree.after[node]
                continue
        there, cell = np.uint64(voxel + tree.offset[node]), tree.cell[node]
        flags = state[there]
        fresh = (flags & UNEXPLORED != 0) & (met[cell] != place)
        met[cell] = place
        points += np.int64(fresh)
        if promises and fresh:
            weighed += _WEIGHTS[counter.promised[there]]
        if flags > _STOPS_RAYS and node > 0:
            node = tree.after[node]
        else:
            node += np.uint32(1)
    return points, weighed if promises else float(points)


@lean_kernel
def raise_bounds(size, opened, voxels, tree, bounds):
    """Raise upper bounds of what is seen from voxels by what may become visible past (N,) int32 opened ones.

    (K,) float64 `bounds` belong to (K,) int32 `voxels`, NONE = no voxel, and were counted with this tree. A
    bound of inf is unknown, and stays so.
    """
    wide = tree.behind.shape
    for place in range(len(voxels)):
        if voxels[place] == NONE or math.isinf(bounds[place]):
            continue
        at = grid_index(size, voxels[place])
        for other in opened:
            x, y, z = grid_index(size, other)
            i, j, k = x - at[0] + wide[0] // 2, y - at[1] + wide[1] // 2, z - at[2] + wide[2] // 2
            if 0 <= i < wide[0] and 0 <= j < wide[1] and 0 <= k < wide[2]:
                bounds[place] += tree.behind[i, j, k]
