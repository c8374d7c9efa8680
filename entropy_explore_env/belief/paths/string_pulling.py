"""Few waypoints in place of a way from voxel to voxel: string pulling by line of sight, in grid units.

From each waypoint the next one is a late voxel of the way that is in sight: the body fits all along
the straight line between them, and the line costs no more than the way that it replaces (rates are
integrated exactly along it). It is found by doubling and halving, so not always the latest one, nor
is the result the shortest of all any-angle ways. Every waypoint is a voxel's centre of the way, and
the result is never dearer than the way.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.paths.lattice import Costs, Lattice
from entropy_explore_env.belief.paths.search import Search, cost_to, is_passable, mark_of, rate_of
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

_SLACK = 1e-9
_GRAZE = 1e-6
"""A line so near to an edge, in voxel edges, goes through it: whoever drives it may be off by rounding."""
_START, _FIRST = np.int64(0), np.int64(1)
"""Stops by number. NumPy integers, so that what takes one compiles for one type."""


@inlined_kernel
def _axis(position, finish, size):
    """(voxel index, step) of a straight line along one axis."""
    index = min(max(int(position), 0), size - 1)
    return index, (1 if finish > position else (-1 if finish < position else 0))


@inlined_kernel
def _share(index, step, position, finish):
    """Share of a straight line up to the next face along an axis: a quotient and no sum of quotients."""
    if step == 0:
        return math.inf
    return (index + (1 if step > 0 else 0) - position) / (finish - position)


@inlined_kernel
def _together(share, nearest, way, shortest):
    """Whether a face that is reached at a share of the line is crossed with the nearest one, at their edge.

    Or so near to it that the line, moved sideways by `_GRAZE`, would meet them the other way round.
    """
    return share < 1.0 and (share - nearest) * min(abs(way), shortest) <= _GRAZE


@lean_kernel
def cost_of_sight(search, lattice, costs, start, finish):
    """Cost of driving straight from one point to another, if nothing is in the way.

    The body has to fit in every voxel that the line crosses, judged at the voxel's centre, and in
    all that it squeezes past where it goes through an edge or a corner, or grazes one. The first voxel
    may be impassable: who stands there may leave.

    Args:
        search: The search that is asked, or any after `_begin`; keeps what was looked at.
        lattice: Where the body fits.
        costs: The belief, or the rates.
        start: (x, y, z) in grid units, inside the workspace.
        finish: (x, y, z), likewise.

    Returns:
        The integral of the rate along the line; inf = something is in the way.
    """
    size = lattice.size
    x, step_x = _axis(start[0], finish[0], size[0])
    y, step_y = _axis(start[1], finish[1], size[1])
    z, step_z = _axis(start[2], finish[2], size[2])
    length = math.sqrt(
        (finish[0] - start[0]) ** 2 + (finish[1] - start[1]) ** 2 + (finish[2] - start[2]) ** 2
    )
    voxel = (x * size[1] + y) * size[2] + z
    rate = rate_of(costs, voxel, mark_of(search, lattice, costs, voxel, x, y, z))
    share, total = 0.0, 0.0
    while True:
        share_x = _share(x, step_x, start[0], finish[0])
        share_y = _share(y, step_y, start[1], finish[1])
        share_z = _share(z, step_z, start[2], finish[2])
        nearest = min(share_x, share_y, share_z)
        if nearest >= 1.0:
            return total + (1.0 - share) * length * rate
        total += (nearest - share) * length * rate
        share = nearest
        by = 0 if share_x == nearest else (1 if share_y == nearest else 2)
        shortest = abs(finish[by] - start[by])
        crossed = (
            _together(share_x, nearest, finish[0] - start[0], shortest)
            + 2 * _together(share_y, nearest, finish[1] - start[1], shortest)
            + 4 * _together(share_z, nearest, finish[2] - start[2], shortest)
        )
        for part in range(1, crossed + 1):  # what is squeezed past; the voxel that is entered comes last
            if part & crossed == part:
                i = x + (step_x if part & 1 else 0)
                j = y + (step_y if part & 2 else 0)
                k = z + (step_z if part & 4 else 0)
                voxel = (i * size[1] + j) * size[2] + k
                mark = mark_of(search, lattice, costs, voxel, i, j, k)
                if not is_passable(mark):
                    return math.inf
                rate = rate_of(costs, voxel, mark)
        x += step_x if crossed & 1 else 0
        y += step_y if crossed & 2 else 0
        z += step_z if crossed & 4 else 0


@inlined_kernel
def _stop(lattice, way, count, start, finish, number):
    """Stop by number: start, centres of the way's voxels, finish; planar bodies keep their height."""
    if number == 0:
        return start[0], start[1], start[2]
    if number > count:
        return finish[0], finish[1], finish[2]
    voxel = way[number - 1]
    column, z = voxel // lattice.size[2], voxel % lattice.size[2] + 0.5
    if lattice.layer >= 0:
        z = start[2]
    return column // lattice.size[1] + 0.5, column % lattice.size[1] + 0.5, z


@inlined_kernel
def _distance(a, b):
    return math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)


@inlined_kernel
def _cost_along(search, lattice, costs, way, count, start, finish, number):
    """Cost of the way from the start up to a stop."""
    if number == 0:
        return 0.0
    first = _stop(lattice, way, count, start, finish, _FIRST)
    mark = np.int64(search.mark[way[0]])
    cost = _distance((start[0], start[1], start[2]), first) * rate_of(costs, way[0], mark)
    cost += cost_to(search, way[min(number, count) - 1]) - cost_to(search, way[0])
    if number > count:
        last = _stop(lattice, way, count, start, finish, count)
        mark = np.int64(search.mark[way[count - 1]])
        cost += _distance(last, (finish[0], finish[1], finish[2])) * rate_of(costs, way[count - 1], mark)
    return cost


@lean_kernel
def _in_sight(search, lattice, costs, way, count, start, finish, here, there):
    """Whether the straight line between two stops is free, and no dearer than the way between them."""
    direct = cost_of_sight(
        search,
        lattice,
        costs,
        _stop(lattice, way, count, start, finish, here),
        _stop(lattice, way, count, start, finish, there),
    )
    along = _cost_along(search, lattice, costs, way, count, start, finish, there)
    along -= _cost_along(search, lattice, costs, way, count, start, finish, here)
    return direct <= along * (1.0 + _SLACK) + _SLACK


@lean_kernel
def pull_straight(search, lattice, costs, way, count, start, finish, waypoints):
    """Fill in the points to which a body has to drive straight, one after the other.

    Args:
        search: The search that found the way, and none after it.
        lattice: As in the search.
        costs: As in the search.
        way: (N,) int32, voxels; `count` ≥ 1 of them.
        count: How many.
        start: (3,) float64 in grid units, in the first voxel.
        finish: (3,) float64, in the last voxel.
        waypoints: (M, 3) float64, filled in; `finish` is the last one. With fewer than N + 2 places
            there may be no room for all: then the first M.

    Returns:
        How many waypoints there are, without the start; 0 = the start is the finish.
    """
    here, last, filled = _START, count + 1, 0
    while here < last and filled < len(waypoints):
        good, beyond, step = here + 1, last + 1, 2
        while good < last and beyond > last:
            trial = min(here + step, last)
            if _in_sight(search, lattice, costs, way, count, start, finish, here, trial):
                good, step = trial, 2 * step
            else:
                beyond = trial
        while good < last and beyond - good > 1:
            trial = (good + beyond) // 2
            if _in_sight(search, lattice, costs, way, count, start, finish, here, trial):
                good = trial
            else:
                beyond = trial
        at = _stop(lattice, way, count, start, finish, here)
        to = _stop(lattice, way, count, start, finish, good)
        if _distance(at, to) > 0.0:
            waypoints[filled, 0], waypoints[filled, 1], waypoints[filled, 2] = to
            filled += 1
        here = good
    return filled


def straightened(
    search: Search, lattice: Lattice, costs: Costs, way: np.ndarray, start: np.ndarray, finish: np.ndarray
) -> np.ndarray:
    """Waypoints in place of a way; see `pull_straight`.

    Args:
        search: The search that found the way, and none after it.
        lattice: As in the search.
        costs: As in the search.
        way: (N,) int32, voxels from start to finish, N ≥ 1.
        start: (3,) in grid units, in the first voxel.
        finish: (3,) in grid units, in the last voxel.

    Returns:
        (M, 3) float64 grid units: points to drive to, without the start.
    """
    waypoints = np.empty((len(way) + 2, 3))
    first, last = np.asarray(start, np.float64), np.asarray(finish, np.float64)
    filled = pull_straight(search, lattice, costs, way, len(way), first, last, waypoints)
    return waypoints[:filled].copy()
