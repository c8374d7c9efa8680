"""Shortest ways between voxel centres through a belief, in voxel edges; exact (Dijkstra 1959; A*, Hart 1968).

Steps and their costs are those of `lattice`. Voxels are looked at only when the search comes near
them, and no array is cleared between searches: a plan costs what it searches, not the world.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.bucket_queue import (
    BucketQueue,
    clear_queue,
    keep_entries,
    new_queue,
    put,
    queue_full,
    take,
)
from entropy_explore_env.belief.lattice import (
    DIAGONALS,
    FREE,
    IMPASSABLE,
    UNKNOWN,
    Costs,
    Lattice,
    look_at,
    place_of,
)
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.compilation import inlined_kernel, lean_kernel
from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import is_whole

UNREACHED = -1
"""Cell of a voxel that no source reaches."""

# A voxel's mark: bits 0-1 what can be done in it, then flags, the step that led to it, the search.
_KIND = 3
_OPEN = 4
"""It waits in the queue."""
_TIGHT = 8
"""The body does not fit, but touches the voxel from the start: it may leave through it."""
_STEP_SHIFT, _STEP = 4, 31 << 4
"""Code of the step that led to the voxel, plus 1; 0 = not reached."""
_SEARCH_SHIFT = 9
_SEARCHES = 2**23 - 1
_NO_STEP = 13
_NARROWER = 1.0 - 2.0**-20
"""Buckets are so much narrower than the least step that rounding puts no two ends of a step into one."""
_PER_STEP_TO_GOAL = 4.0
"""Buckets per least step where a goal is sought: fewer voxels are looked at twice."""

_SQRT2, _SQRT3 = DIAGONALS[1], DIAGONALS[2]
_NOWHERE = -1


class Search(NamedTuple):
    """Working space and result of a search, for one search at a time.

    The memory of V voxels is taken where a search comes to: 12 bytes a voxel, and the queue's.
    """

    cost: np.ndarray
    """(V,) float64, cost of reaching a voxel, where `mark` says that it was reached.

    Not float32: its rounding would grow with every step, beyond 1e-6 of the cost.
    """
    mark: np.ndarray
    """(V,) uint32: see the constants above; of an earlier search where its number is another."""
    queue: BucketQueue
    searches: np.ndarray
    """(1,) int64, number of the latest search."""


def new_search(voxels: int) -> Search:
    """Working space for worlds of this many voxels; nothing is written yet."""
    return Search(
        np.empty(voxels, np.float64),
        np.zeros(voxels, np.uint32),
        new_queue(voxels + voxels // 8),
        np.zeros(1, np.int64),
    )


@inlined_kernel
def mark_of(search, lattice, costs, voxel, x, y, z):
    """Mark of a voxel in this search; looks at the voxel if that was not done."""
    mark, number = np.int64(search.mark[voxel]), search.searches[0]
    if mark >> _SEARCH_SHIFT != number:
        kind = look_at(lattice, costs, voxel, x, y, z, 0, len(lattice.touched))
        mark = number << _SEARCH_SHIFT | kind
        search.mark[voxel] = np.uint32(mark)
    return mark


@inlined_kernel
def is_passable(mark):
    """Whether the voxel of a mark can be entered."""
    return mark & _KIND != IMPASSABLE


@inlined_kernel
def rate_of(costs, voxel, mark):
    """Cost of a voxel edge of way through a voxel; the least rate in a start that is impassable."""
    kind = mark & _KIND
    if kind == IMPASSABLE:
        return costs.least_rate
    if len(costs.rates) > 0:
        return np.float64(costs.rates[voxel])
    return costs.unknown_cost if kind == UNKNOWN else 1.0


@inlined_kernel
def _to_goal(x, y, z, goal_x, goal_y, goal_z):
    """Length of the shortest way by steps if nothing is in it: √3 a space diagonal, √2 a plane one."""
    x, y, z = abs(goal_x - x), abs(goal_y - y), abs(goal_z - z)
    longest, shortest = max(x, y, z), min(x, y, z)
    middle = x + y + z - longest - shortest
    return (longest - middle) + _SQRT2 * (middle - shortest) + _SQRT3 * shortest


@lean_kernel
def _let_leave(search, lattice, costs, voxel):
    """Let a body that does not fit where it starts leave through uncovered voxels that it touches."""
    number, size = search.searches[0], lattice.size
    x, y, z = place_of(lattice, voxel)
    for offset in lattice.touched:
        i, j, k = x + offset[0], y + offset[1], z + offset[2]
        if 0 <= i < size[0] and 0 <= j < size[1] and 0 <= k < size[2]:
            near = (i * size[1] + j) * size[2] + k
            if near != voxel and (lattice.layer < 0 or k == lattice.layer):
                mark = mark_of(search, lattice, costs, near, i, j, k)
                if mark & _KIND == IMPASSABLE and costs.mean[near] <= STOP_AT_COVERED:
                    kind = UNKNOWN if costs.precision[near] < costs.known_precision else FREE
                    search.mark[near] = np.uint32(number << _SEARCH_SHIFT | _TIGHT | kind)


@lean_kernel
def _begin(search, lattice, costs, sources, cells):
    """Forget the search before, and put the sources into the queue."""
    search.searches[0] += 1
    if search.searches[0] > _SEARCHES:  # once in millions of searches
        search.mark[:] = 0
        search.searches[0] = 1
    clear_queue(search.queue)
    for source in sources:
        x, y, z = place_of(lattice, source)
        mark = mark_of(search, lattice, costs, source, x, y, z)
        if (mark & _KIND == IMPASSABLE or mark & _TIGHT) and len(lattice.touched) > 0:
            _let_leave(search, lattice, costs, source)
    for index in range(len(sources)):
        source = sources[index]
        mark = np.int64(search.mark[source])
        if mark & _STEP == 0:
            search.cost[source] = 0.0
            search.mark[source] = np.uint32(mark | _OPEN | (_NO_STEP + 1) << _STEP_SHIFT)
            if len(cells) > 0:
                cells[source] = index
            put(search.queue, 0, source)


@inlined_kernel
def _passable_moves(search, lattice, costs, voxel, x, y, z):
    """Bits, by code of a move, of the neighbours that can be entered at all."""
    size, number, marks = lattice.size, search.searches[0], search.mark
    mark = np.int64(marks[voxel])
    fits = mark & _KIND != IMPASSABLE and not mark & _TIGHT
    inner = 0 < x < size[0] - 1 and 0 < y < size[1] - 1 and (lattice.layer >= 0 or 0 < z < size[2] - 1)
    passable = 0
    for move in lattice.moves:
        i, j, k = x + move.step[0], y + move.step[1], z + move.step[2]
        if inner or (0 <= i < size[0] and 0 <= j < size[1] and 0 <= k < size[2]):
            near = voxel + move.offset
            mark = np.int64(marks[near])
            if mark >> _SEARCH_SHIFT != number:
                # Where the body fits here, only what it newly touches has to be looked at.
                first, last = (move.first, move.last) if fits else (0, len(lattice.touched))
                mark = number << _SEARCH_SHIFT | look_at(lattice, costs, near, i, j, k, first, last)
                marks[near] = np.uint32(mark)
            if mark & _KIND != IMPASSABLE:
                passable |= 1 << move.code
    return passable


@lean_kernel
def search_ways(search, lattice, costs, sources, goal, reach, cells):
    """Find the cheapest ways from the nearest of several sources to a goal, or to all voxels.

    A voxel whose way is found to be cheaper after it was worked off is worked off again, so that the
    result does not hang on the width of the buckets. With a goal only what is on the found way is
    final. Sources may be impassable: a start inside a covered voxel may be left, and counts with the
    least rate. Of sources at the same cost the first one has the voxel.

    Args:
        search: Filled in; read it by `cost_to`, `way_to` and `collect`.
        lattice: The steps.
        costs: The belief, or the rates.
        sources: (S,) int32, voxels.
        goal: A voxel; -1 = all.
        reach: Largest cost; inf allowed.
        cells: (V,) int32, where a voxel is reached filled with the number of its source; empty = not
            wanted. Only for searches without a goal.

    Returns:
        Cost of the goal, inf = not reached within `reach`; without a goal 0.
    """
    _begin(search, lattice, costs, sources, cells)
    marks, cost, queue, number = search.mark, search.cost, search.queue, search.searches[0]
    limit = np.nextafter(reach, math.inf)
    per_cost = _NARROWER**-1 / costs.least_rate
    goal_x, goal_y, goal_z = 0, 0, 0
    if goal != _NOWHERE:
        goal_x, goal_y, goal_z = place_of(lattice, goal)
        mark = mark_of(search, lattice, costs, goal, goal_x, goal_y, goal_z)
        if mark & _STEP != 0:
            return 0.0
        if mark & _KIND == IMPASSABLE:
            return math.inf
        per_cost *= _PER_STEP_TO_GOAL
    while True:
        voxel = take(queue)
        if voxel == _NOWHERE or queue.numbers[0].current > limit * per_cost:
            break
        mark = np.int64(marks[voxel])
        if not mark & _OPEN:
            continue
        x, y, z = place_of(lattice, voxel)
        here = cost[voxel]
        ahead = here
        if goal != _NOWHERE:
            ahead += costs.least_rate * _to_goal(x, y, z, goal_x, goal_y, goal_z)
        if int(ahead * per_cost) > queue.numbers[0].current:  # it was too far ahead for the ring
            put(queue, int(ahead * per_cost), voxel)
            continue
        marks[voxel] = np.uint32(mark ^ _OPEN)
        if ahead >= limit:
            continue
        rate = rate_of(costs, voxel, mark)
        passable = _passable_moves(search, lattice, costs, voxel, x, y, z)
        for move in lattice.moves:
            if passable & move.needs != move.needs:
                continue
            near = voxel + move.offset
            mark = np.int64(marks[near])
            there = here + 0.5 * move.length * (rate + rate_of(costs, near, mark))
            before = math.inf
            if mark & _STEP:
                before = cost[near]
                if there > before or (there == before and (len(cells) == 0 or cells[voxel] >= cells[near])):
                    continue
            left = 0.0
            if goal != _NOWHERE:
                step = move.step
                left = costs.least_rate * _to_goal(
                    x + step[0], y + step[1], z + step[2], goal_x, goal_y, goal_z
                )
            if there + left >= limit:
                continue
            cost[near] = there
            if len(cells) > 0:
                cells[near] = cells[voxel]
            opened = mark & _OPEN
            mark = number << _SEARCH_SHIFT | (move.code + 1) << _STEP_SHIFT | mark & (_KIND | _TIGHT)
            if near == goal:
                marks[near] = np.uint32(mark)
                limit = there
                continue
            marks[near] = np.uint32(mark | _OPEN)
            bucket = int((there + left) * per_cost)
            if not opened or bucket < int((before + left) * per_cost):
                put(queue, bucket, near)
                if queue_full(queue):
                    keep_entries(queue, marks, _OPEN)
    return cost_to(search, goal) if goal != _NOWHERE else 0.0


@inlined_kernel
def cost_to(search, voxel):
    """Cost of a voxel in the latest search; inf = not reached."""
    mark = np.int64(search.mark[voxel])
    reached = mark >> _SEARCH_SHIFT == search.searches[0] and mark & _STEP != 0
    return search.cost[voxel] if reached else math.inf


@inlined_kernel
def _before(search, lattice, voxel):
    """The voxel from which a reached one was reached; -1 = it is a source."""
    code = ((np.int64(search.mark[voxel]) & _STEP) >> _STEP_SHIFT) - 1
    if code == _NO_STEP:
        return _NOWHERE
    column = (code // 9 - 1) * lattice.size[1] + code // 3 % 3 - 1
    return voxel - column * lattice.size[2] - code % 3 + 1


@lean_kernel
def way_to(search, lattice, voxel, way):
    """The way from its source to a voxel.

    Args:
        search: The latest search.
        lattice: Its steps.
        voxel: Where the way ends.
        way: (N,) int32, filled with the voxels from the source on, both ends with it, if they fit.

    Returns:
        How many voxels there are; 0 = the voxel was not reached. More than N: nothing was filled in.
    """
    if math.isinf(cost_to(search, voxel)):
        return 0
    count, at = 1, voxel
    while _before(search, lattice, at) != _NOWHERE:
        at = _before(search, lattice, at)
        count += 1
    if count <= len(way):
        at = voxel
        for index in range(count - 1, -1, -1):
            way[index] = at
            at = _before(search, lattice, at)
    return count


@lean_kernel
def collect(search, out):
    """Fill (V,) float64 with the costs of the latest search; inf = not reached."""
    for voxel in range(len(out)):
        out[voxel] = cost_to(search, voxel)


class Geodesics(NamedTuple):
    """Costs of ways to all voxels, from the nearest source each."""

    cost: np.ndarray
    """(X, Y, Z) float64; inf = not reached."""
    cell: np.ndarray
    """(X, Y, Z) int32, index of that source, the first of equals; UNREACHED = none: Voronoi cells."""


def geodesics(
    search: Search, lattice: Lattice, costs: Costs, sources: np.ndarray, reach: float = math.inf
) -> Geodesics:
    """Costs of the ways from the nearest of S sources to all voxels, and which source that is.

    Args:
        search: Working space; a single voxel is asked by `cost_to`, its way by `way_to`.
        lattice: The steps.
        costs: The belief, or the rates.
        sources: (S,) voxels by number, S ≥ 1.
        reach: Voxels at a larger cost are not reached.

    Raises:
        SettingError: A source is no voxel of the lattice, or `reach` is no number ≥ 0.
    """
    numbers = np.atleast_1d(np.asarray(sources)).astype(np.int32)
    if len(numbers) == 0:
        raise SettingError("sources", (), "at least one voxel")
    for source in numbers.tolist():
        _check_voxel(lattice, "sources", source)
    _check_fit(search, lattice, costs, reach)
    cell = np.full(lattice.size, UNREACHED, np.int32)
    cost = np.empty(lattice.size, np.float64)
    search_ways(search, lattice, costs, numbers, _NOWHERE, float(reach), cell.reshape(-1))
    collect(search, cost.reshape(-1))
    return Geodesics(cost, cell)


def shortest_way(
    search: Search, lattice: Lattice, costs: Costs, start: int, goal: int, reach: float = math.inf
) -> tuple[float, np.ndarray]:
    """The cheapest way from a voxel to another.

    Args:
        search: Working space.
        lattice: The steps.
        costs: The belief, or the rates.
        start: Number of a voxel; may be impassable.
        goal: Likewise; reached only if it is passable, or the start.
        reach: Ways at a larger cost are not found.

    Returns:
        Its cost, and (N,) int32 the voxels from start to goal; (inf, none) if there is no way.

    Raises:
        SettingError: Start or goal is no voxel of the lattice, or `reach` is no number ≥ 0.
    """
    _check_voxel(lattice, "start", start)
    _check_voxel(lattice, "goal", goal)
    _check_fit(search, lattice, costs, reach)
    cost = search_ways(
        search, lattice, costs, np.array([start], np.int32), int(goal), float(reach), np.zeros(0, np.int32)
    )
    way = np.empty(way_to(search, lattice, int(goal), np.empty(0, np.int32)), np.int32)
    way_to(search, lattice, int(goal), way)
    return float(cost), way


def _check_voxel(lattice: Lattice, field: str, voxel: int) -> None:
    voxels = math.prod(lattice.size)
    if not is_whole(voxel, 0, voxels - 1):
        raise SettingError(field, voxel, f"the number of a voxel, from 0 to {voxels - 1}")
    if lattice.layer >= 0 and voxel % lattice.size[2] != lattice.layer:
        raise SettingError(field, voxel, f"a voxel of layer {lattice.layer}")


def _check_fit(search: Search, lattice: Lattice, costs: Costs, reach: float) -> None:
    voxels = math.prod(lattice.size)
    if len(search.mark) != voxels:
        raise SettingError("search", len(search.mark), f"working space for {voxels} voxels")
    field = len(costs.rates) or len(costs.mean)
    if field != voxels or (len(costs.rates) == 0 and len(costs.precision) != voxels):
        raise SettingError("costs", field, f"a field of {voxels} voxels")
    if not reach >= 0.0:
        raise SettingError("reach", reach, "a number ≥ 0, or inf")
