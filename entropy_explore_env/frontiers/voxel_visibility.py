"""How many unexplored points are expected to be seen from a place: the V of Sawhney 2009, sects. 3.4-3.5.

In a map of voxels rays go out until something believed covered stops them, or to the sensor's range; each
unexplored voxel that they cross counts once. Over a height field (terrain/visibility.py) points are columns.
A point that n robots have promised to see has the weight 1/(1 + n). (The paper's 1/n would not reduce the
weight for the first promise.) The naive V, for comparison, counts all unexplored points in a ball whose
radius is the range. Grid units.
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
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.frontiers.ray_tree import RayTree, cell_at
from entropy_explore_env.frontiers.voxel_map import NONE, STOPS_RAYS, UNEXPLORED

MOST_RAYS = 720


class VisibilityCounter(NamedTuple):
    """Counts visible points, and notes which ones robots promised to see; N points."""

    stamp: np.ndarray
    """(N,) int32, number of the latest count that met a point."""
    promised: np.ndarray
    """(N,) uint8, number of robots that will see a point."""
    promised_points: np.ndarray
    """(N,) int32, points with promises; the first `promised_count`."""
    promised_count: np.ndarray
    """(1,) int64."""
    latest: np.ndarray
    """(1,) int64, number of the latest count."""
    crossed: np.ndarray
    """(L,) int32, scratch space of `cast_ray`."""
    entered: np.ndarray
    """(L,) int64, scratch space of `cast_ray`."""


def new_counter(points: int, shape: tuple[int, int, int]) -> VisibilityCounter:
    """A counter for a map of this shape, without promises."""
    longest = longest_crossing(*shape, math.inf, 2)
    return VisibilityCounter(
        np.zeros(points, np.int32),
        np.zeros(points, np.uint8),
        np.zeros(points, np.int32),
        np.zeros(1, np.int64),
        np.zeros(1, np.int64),
        np.zeros(longest, np.int32),
        np.zeros(longest, np.int64),
    )


def rays_around(reach: float, pitches: np.ndarray) -> np.ndarray:
    """(D, 3) float64 unit vectors all around: in plans one for every voxel edge at `reach`, up to MOST_RAYS.

    Args:
        reach: In voxel edges.
        pitches: (rows,) radians downwards; with more than one row at most 32 to a turn.
    """
    turns = min(math.ceil(2.0 * math.pi * min(reach, 1e4)), MOST_RAYS if len(pitches) == 1 else 32)
    return rays_towards((np.arange(turns) + 0.5) * (2.0 * math.pi / turns), pitches)


def rays_towards(yaws: np.ndarray, pitches: np.ndarray) -> np.ndarray:
    """(D, 3) float64 unit vectors of all pairs of yaw and pitch, radians."""
    yaw, pitch = (axis.reshape(-1) for axis in np.meshgrid(yaws, pitches, indexing="ij"))
    level = np.cos(pitch)
    return np.stack([np.cos(yaw) * level, np.sin(yaw) * level, -np.sin(pitch)], axis=-1)


@inlined_kernel
def weight(promises):
    """Weight of a point that this many robots have promised to see."""
    return 1.0 / (1.0 + promises)


_WEIGHTS = 1.0 / (1.0 + np.arange(256))
"""Weights by number of promises."""


@inlined_kernel
def start_count(counter):
    """Start a new count; returns its number."""
    counter.latest[0] += 1
    if counter.latest[0] > 2**31 - 2:  # once in a lifetime
        for point in range(len(counter.stamp)):
            counter.stamp[point] = 0
        counter.latest[0] = 1
    return np.int32(counter.latest[0])


@inlined_kernel
def promise(counter, point):
    """Note that one more robot will see a point."""
    if counter.promised[point] == 0:
        counter.promised_points[counter.promised_count[0]] = point
        counter.promised_count[0] += 1
    counter.promised[point] = min(np.int64(counter.promised[point]) + 1, 255)


@inlined_kernel
def count_point(counter, point, marking):
    """Weight of a visible point; if `marking`, one more robot promises to see it."""
    value = weight(counter.promised[point])
    if marking:
        promise(counter, point)
    return value


@lean_kernel
def clear_promises(counter):
    """Release all promises."""
    for place in range(counter.promised_count[0]):
        counter.promised[counter.promised_points[place]] = 0
    counter.promised_count[0] = 0


@lean_kernel
def count_crossed(counter, state, size, start, directions, reach, marking):
    """Unexplored voxels that rays from a place cross: (all, weighed by promises).

    Args:
        counter: The counter.
        state: (V,) uint8 of a FrontierMap.
        size: (X, Y, Z) voxels.
        start: (3,) float64, the place.
        directions: (D, 3) float64 unit vectors.
        reach: Of the rays, in voxel edges; inf allowed.
        marking: Whether the robot promises to see these voxels.
    """
    number = start_count(counter)
    return _count_more(counter, number, state, size, start, directions, reach, marking)


@lean_kernel
def count_together(counter, state, size, starts, directions, reach):
    """Unexplored voxels that rays from any of (N, 3) places cross, weighed by promises: `count_crossed`."""
    number, weighed = start_count(counter), 0.0
    for start in starts:
        weighed += _count_more(counter, number, state, size, start, directions, reach, False)[1]
    return weighed


@lean_kernel
def _count_more(counter, number, state, size, start, directions, reach, marking):
    """`count_crossed`, of the voxels that the count of this number has not met yet."""
    points, weighed = 0, 0.0
    begin = (start[0], start[1], start[2])
    for ray in range(len(directions)):
        direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
        _, n, _ = cast_ray(
            state,
            size,
            Line(begin, direction, reach),
            STOPS_RAYS,
            OPEN_END,
            ONE_BEHIND,
            Crossing(counter.crossed, counter.entered),
        )
        for place in range(n):
            voxel = np.uint32(counter.crossed[place])
            if state[voxel] & UNEXPLORED and counter.stamp[voxel] != number:
                counter.stamp[voxel] = number
                points += 1
                weighed += count_point(counter, voxel, marking)
    return points, weighed


@lean_kernel
def count_in_ball(counter, state, size, start, reach, marking):
    """The naive V: unexplored voxels with their centres within reach of a place, seen or not."""
    points, weighed = 0, 0.0
    wide = min(reach, size[0] + size[1] + size[2])
    for x in range(max(int(start[0] - wide - 0.5), 0), min(int(start[0] + wide + 1.0), size[0])):
        for y in range(max(int(start[1] - wide - 0.5), 0), min(int(start[1] + wide + 1.0), size[1])):
            for z in range(max(int(start[2] - wide - 0.5), 0), min(int(start[2] + wide + 1.0), size[2])):
                dx, dy, dz = x + 0.5 - start[0], y + 0.5 - start[1], z + 0.5 - start[2]
                voxel = flat_index(size, x, y, z)
                if dx * dx + dy * dy + dz * dz <= wide * wide and state[voxel] & UNEXPLORED:
                    points += 1
                    weighed += count_point(counter, voxel, marking)
    return points, weighed


class _Rays(NamedTuple):
    """Rays from any voxel, and what they go through."""

    state: np.ndarray
    """(V,) uint8 of a FrontierMap."""
    size: tuple[int, int, int]
    """(X, Y, Z) voxels."""
    tree: RayTree
    met: np.ndarray
    """(C,) int32, the latest start whose rays met each cell of the tree."""


class _Start(NamedTuple):
    """The voxel in which rays start."""

    voxel: np.int64
    at: tuple[int, int, int]
    """Its indices."""
    place: int
    """Its number in the call."""


@lean_kernel
def count_from(counter, state, size, voxels, tree, met, seen, weighed):
    """Fill (K,) `seen` with the points seen from K voxels' centres, (K,) `weighed` with the sums of weights.

    The same as `count_crossed` finds, with the rays as a RayTree of C cells; `met` is (C,) int32 scratch
    space.
    """
    for cell in range(len(met)):
        met[cell] = -1
    promises, nodes, rays = counter.promised_count[0] > 0, len(tree.offset), _Rays(state, size, tree, met)
    for place in range(len(voxels)):
        voxel = np.int64(voxels[place])
        at = grid_indices(size, voxel)
        inside, start = _inside(tree, size, at), _Start(voxel, at, place)
        if inside and not promises:
            points, value = _count_branches(counter, rays, start, 0, nodes, True, False)
        elif inside:
            points, value = _count_branches(counter, rays, start, 0, nodes, True, True)
        else:
            points, value = _count_branches(counter, rays, start, 0, nodes, False, True)
        seen[place], weighed[place] = points, value


@inlined_kernel
def _inside(tree, size, at):
    """Whether no ray from a voxel leaves the workspace."""
    inside = True
    for axis in range(3):
        inside &= at[axis] + tree.low[axis] >= 0 and at[axis] + tree.high[axis] < size[axis]
    return inside


@inlined_kernel
def _count_branches(counter, rays, start, first, last, inside, promises):
    """Count along the tree's branches, its nodes `first` … `last` - 1: (all, weighed). See `count_from`.

    With `inside` no ray leaves the workspace, and without `promises` all weights are 1: both save time.
    """
    state, size, tree, met = rays.state, rays.size, rays.tree, rays.met
    voxel, at, place = start.voxel, start.at, start.place
    points, weighed, node = 0, 0.0, np.uint32(first)
    while node < np.uint32(last):
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
        if flags > STOPS_RAYS and node > 0:
            node = tree.after[node]
        else:
            node += np.uint32(1)
    return points, weighed if promises else float(points)


@lean_kernel
def add_opened(counter, state, size, opened, voxels, tree, met, seen):
    """Add to upper bounds of what is seen from K voxels what becomes visible through newly freed voxels.

    So the bounds stay valid: nothing else can make more visible than before.

    Args:
        counter: The counter; not changed.
        state: (V,) uint8 of a FrontierMap.
        size: (X, Y, Z) voxels.
        opened: (N,) int32, voxels that turned free since the bounds were last updated.
        voxels: (K,) int32; NONE = no voxel.
        tree: The RayTree of C cells with which the bounds were counted.
        met: (C,) int32 scratch space.
        seen: (K,) float32 bounds, changed in place; inf = unknown, and stays so.
    """
    rays = _Rays(state, size, tree, met)
    for cell in range(len(met)):
        met[cell] = -1
    for place in range(len(voxels)):
        if voxels[place] == NONE or math.isinf(seen[place]):
            continue
        voxel = np.int64(voxels[place])
        at = grid_indices(size, voxel)
        start = _Start(voxel, at, place)
        for other in opened:
            x, y, z = grid_indices(size, other)
            cell = cell_at(tree, x - at[0], y - at[1], z - at[2])
            if cell < 0:
                continue
            for number in range(tree.first[cell], tree.first[cell + 1]):
                node = np.int64(tree.nodes[number])
                if node > 0 and _is_reached(state, voxel, tree, node):
                    first, last = node + 1, tree.after[node]
                    seen[place] += _count_branches(counter, rays, start, first, last, False, False)[0]


@lean_kernel
def _is_reached(state, voxel, tree, node):
    """Whether nothing stops the rays from a voxel before a node of their tree."""
    at = np.int64(0)
    while at != node:
        after = np.int64(tree.after[at])
        if node >= after:
            at = after
            continue
        if at > 0 and state[voxel + tree.offset[at]] > STOPS_RAYS:
            return False
        at += 1
    return True


@lean_kernel
def count_in_balls(counter, state, size, voxels, reach, seen, weighed):
    """`count_from` with the naive V."""
    for place in range(len(voxels)):
        start = centre_of(size, voxels[place])
        seen[place], weighed[place] = count_in_ball(counter, state, size, start, reach, False)


@inlined_kernel
def centre_of(size, voxel):
    """(x, y, z) of a voxel's centre."""
    x, y, z = grid_indices(size, voxel)
    return x + 0.5, y + 0.5, z + 0.5


@inlined_kernel
def grid_indices(size, voxel):
    """(x, y, z) of a voxel, whole numbers.

    As `grid_index`, by integer division: V of a candidate is counted 10 % faster than with that one.
    """
    column = voxel // size[2]
    return column // size[1], column % size[1], voxel - column * size[2]
