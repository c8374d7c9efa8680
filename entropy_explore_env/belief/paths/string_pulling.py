"""Few waypoints in place of a path from voxel to voxel: string pulling by line of sight, in grid units.

From each waypoint the next one is a late voxel of the path that is in line of sight: the body fits all along
the straight line between them, and the line costs no more than the part of the path that it replaces (the
traversal cost is integrated exactly along it). That voxel is found by doubling and halving, so it is not
always the last possible one, and the result is not the shortest of all any-angle paths. Every waypoint but
the last is the centre of a voxel of the path, and the result never costs more than the path.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import Costs, Lattice
from entropy_explore_env.belief.paths.search import Search, cost_per_edge, cost_to, is_passable, mark_of
from entropy_explore_env.belief.raycast import distance_between, point
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

_SLACK = 1e-9
_EDGE_TOLERANCE = 1e-6
"""A line that passes an edge at this distance, in voxel edges, counts as crossing it: rounding may do so."""
_START, _FIRST = np.int64(0), np.int64(1)
"""Stops by number. NumPy integers, so that kernels which take one are compiled for one type."""


class Path(NamedTuple):
    """A path from voxel to voxel, and the points at its ends.

    Its stops are numbered: 0 = the start, then the centres of its voxels, `count` + 1 = the finish.
    """

    voxels: np.ndarray
    """(N,) int32, of which the first `count` are the path."""
    count: int
    """≥ 1."""
    start: np.ndarray
    """(3,) float64 in grid units, in the first voxel."""
    finish: np.ndarray
    """(3,) float64 in grid units, in the last voxel."""


@inlined_kernel
def _axis(position, finish, size):
    """Return (voxel index, step) of a straight line along one axis."""
    index = min(max(int(position), 0), size - 1)
    return index, (1 if finish > position else (-1 if finish < position else 0))


@inlined_kernel
def _share(index, step, position, finish):
    """Share of a straight line up to the next face along an axis; one quotient, so errors do not add up."""
    if step == 0:
        return math.inf
    return (index + (1 if step > 0 else 0) - position) / (finish - position)


@inlined_kernel
def _at_edge(share, nearest, extent, shortest):
    """Return whether the face at a share of the line is crossed together with the nearest one, at their edge.

    Or so near to the edge that the line, moved sideways by `_EDGE_TOLERANCE`, would cross the faces in the
    other order.
    """
    return share < 1.0 and (share - nearest) * min(abs(extent), shortest) <= _EDGE_TOLERANCE


@lean_kernel
def line_of_sight_cost(search, lattice, costs, start, finish):
    """Return the cost of a straight drive from one point to another; inf if it is not free.

    The body has to fit in every voxel that the line crosses, with its centre at the voxel's centre, and in
    all voxels at an edge or corner that the line crosses or nearly touches. The first voxel may be
    impassable: a body that starts there may leave.

    Args:
        search: The latest search, or one after `start_search`; voxels that are classified here keep their
            marks.

    Returns:
        The integral of the traversal cost along the line; inf = an impassable voxel is on it.
    """
    size = lattice.size
    x, step_x = _axis(start[0], finish[0], size[0])
    y, step_y = _axis(start[1], finish[1], size[1])
    z, step_z = _axis(start[2], finish[2], size[2])
    length = distance_between(start, finish)
    voxel = flat_index(size, x, y, z)
    per_edge = cost_per_edge(lattice, costs, voxel, mark_of(search, lattice, costs, voxel, x, y, z))
    share, total = 0.0, 0.0
    while True:
        share_x = _share(x, step_x, start[0], finish[0])
        share_y = _share(y, step_y, start[1], finish[1])
        share_z = _share(z, step_z, start[2], finish[2])
        nearest = min(share_x, share_y, share_z)
        if nearest >= 1.0:
            return total + (1.0 - share) * length * per_edge
        total += (nearest - share) * length * per_edge
        share = nearest
        by = 0 if share_x == nearest else (1 if share_y == nearest else 2)
        shortest = abs(finish[by] - start[by])
        crossed = (
            _at_edge(share_x, nearest, finish[0] - start[0], shortest)
            + 2 * _at_edge(share_y, nearest, finish[1] - start[1], shortest)
            + 4 * _at_edge(share_z, nearest, finish[2] - start[2], shortest)
        )
        for part in range(1, crossed + 1):  # voxels at the edge; the one that is entered comes last
            if part & crossed == part:
                i = x + (step_x if part & 1 else 0)
                j = y + (step_y if part & 2 else 0)
                k = z + (step_z if part & 4 else 0)
                voxel = flat_index(size, i, j, k)
                mark = mark_of(search, lattice, costs, voxel, i, j, k)
                if not is_passable(mark):
                    return math.inf
                per_edge = cost_per_edge(lattice, costs, voxel, mark)
        x += step_x if crossed & 1 else 0
        y += step_y if crossed & 2 else 0
        z += step_z if crossed & 4 else 0


@inlined_kernel
def _stop(lattice, path, number):
    """Return (x, y, z) of a stop by its number; planar bodies keep the height of the start."""
    if number == 0:
        return path.start[0], path.start[1], path.start[2]
    if number > path.count:
        return path.finish[0], path.finish[1], path.finish[2]
    voxel = path.voxels[number - 1]
    column, z = voxel // lattice.size[2], voxel % lattice.size[2] + 0.5
    if lattice.layer >= 0:
        z = path.start[2]
    return column // lattice.size[1] + 0.5, column % lattice.size[1] + 0.5, z


@inlined_kernel
def _cost_along(search, lattice, costs, path, number):
    """Return the cost of the path from the start to a stop."""
    if number == 0:
        return 0.0
    voxels, start, finish = path.voxels, path.start, path.finish
    first = _stop(lattice, path, _FIRST)
    mark = np.int64(search.mark[voxels[0]])
    cost = distance_between(point(start), first) * cost_per_edge(lattice, costs, voxels[0], mark)
    cost += cost_to(search, voxels[min(number, path.count) - 1]) - cost_to(search, voxels[0])
    if number > path.count:
        last, end = _stop(lattice, path, path.count), voxels[path.count - 1]
        mark = np.int64(search.mark[end])
        cost += distance_between(last, point(finish)) * cost_per_edge(lattice, costs, end, mark)
    return cost


@lean_kernel
def _in_sight(search, lattice, costs, path, here, there):
    """Return whether the line between two stops is free and costs no more than the path between them."""
    direct = line_of_sight_cost(
        search, lattice, costs, _stop(lattice, path, here), _stop(lattice, path, there)
    )
    along = _cost_along(search, lattice, costs, path, there)
    along -= _cost_along(search, lattice, costs, path, here)
    return direct <= along * (1.0 + _SLACK) + _SLACK


@lean_kernel
def string_pull(search, lattice, costs, path, waypoints):
    """Fill in the waypoints of a path: the points to which the body has to drive straight, in order.

    Args:
        search: The search that found the path, and none after it.
        waypoints: (M, 3) float64, filled in; the finish is the last one. If there are more than M, only the
            first M are filled in; N + 2 always suffice.

    Returns:
        Number of waypoints, the start not counted; 0 = the start is the finish.
    """
    here, last, filled = _START, path.count + 1, 0
    while here < last and filled < len(waypoints):
        good, bad, step = here + 1, last + 1, 2
        while good < last and bad > last:
            trial = min(here + step, last)
            if _in_sight(search, lattice, costs, path, here, trial):
                good, step = trial, 2 * step
            else:
                bad = trial
        while good < last and bad - good > 1:
            trial = (good + bad) // 2
            if _in_sight(search, lattice, costs, path, here, trial):
                good = trial
            else:
                bad = trial
        at, to = _stop(lattice, path, here), _stop(lattice, path, good)
        if distance_between(at, to) > 0.0:
            waypoints[filled, 0], waypoints[filled, 1], waypoints[filled, 2] = to
            filled += 1
        here = good
    return filled


def string_pulled(
    search: Search, lattice: Lattice, costs: Costs, voxels: np.ndarray, start: np.ndarray, finish: np.ndarray
) -> np.ndarray:
    """Return waypoints in place of a path; see `string_pull`.

    Args:
        search: The search that found the path, and none after it.
        lattice: As in the search.
        costs: As in the search.
        voxels: (N,) int32, the path's voxels from start to finish, N ≥ 1.
        start: (3,) in grid units, in the first voxel.
        finish: (3,) in grid units, in the last voxel.

    Returns:
        (M, 3) float64 grid units: points to drive to, without the start.
    """
    waypoints = np.empty((len(voxels) + 2, 3))
    first, last = np.asarray(start, np.float64), np.asarray(finish, np.float64)
    filled = string_pull(search, lattice, costs, Path(voxels, len(voxels), first, last), waypoints)
    return waypoints[:filled].copy()
