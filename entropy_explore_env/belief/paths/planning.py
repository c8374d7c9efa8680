"""Shortest ways between voxel centres through a belief, in voxel edges; exact (Dijkstra 1959; A*, Hart 1968).

Steps and their costs are those of `lattice`. Voxels are looked at only when the search comes near
them, and no array is cleared between searches: a plan costs what it searches, not the world.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.bucket_queue import (
    clear_queue,
    free_block,
    go_on,
    keep_entries,
    put,
    queue_full,
    take_block,
)
from entropy_explore_env.belief.paths.lattice import (
    DIAGONALS,
    FREE,
    IMPASSABLE,
    UNKNOWN,
    Costs,
    Lattice,
    is_closed,
    look_at,
    place_of,
)
from entropy_explore_env.belief.paths.search import (
    KIND,
    NO_STEP,
    OPEN,
    SEARCH_SHIFT,
    SEARCHES,
    STEP,
    STEP_SHIFT,
    TIGHT,
    Search,
    collect,
    cost_to,
    mark_of,
    rate_of,
    way_to,
)
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import is_whole

UNREACHED = -1
"""Cell of a voxel that no source reaches."""

_NARROWER = 1.0 - 2.0**-20
"""Buckets are so much narrower than the least step that rounding puts no two ends of a step into one."""
_PER_STEP_TO_GOAL = 4.0
"""Buckets per least step where a goal is sought: fewer voxels are looked at twice."""

_SQRT2, _SQRT3 = DIAGONALS[1], DIAGONALS[2]
_NOWHERE = -1
_IN_LAYER = 8
"""Moves of a search in one layer."""


@inlined_kernel
def _to_goal(voxel, goal):
    """Length of the shortest way by steps from (x, y, z) to another voxel if nothing is between."""
    x, y, z = abs(goal[0] - voxel[0]), abs(goal[1] - voxel[1]), abs(goal[2] - voxel[2])
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
                open_there = costs.mean[near] <= STOP_AT_COVERED and not is_closed(costs, near)
                if mark & KIND == IMPASSABLE and open_there:
                    kind = UNKNOWN if costs.precision[near] < costs.known_precision else FREE
                    search.mark[near] = np.uint32(number << SEARCH_SHIFT | TIGHT | kind)


@lean_kernel
def begin_search(search, lattice, costs, sources, cells):
    """Forget the search before, and begin one: of `search_ways`, or to all voxels for `widen_search`.

    Arguments as of `search_ways`.
    """
    search.searches[0] += 1
    if search.searches[0] > SEARCHES:  # once in millions of searches
        search.mark[:] = 0
        search.searches[0] = 1
    clear_queue(search.queue)
    for source in sources:
        x, y, z = place_of(lattice, source)
        mark = mark_of(search, lattice, costs, source, x, y, z)
        if (mark & KIND == IMPASSABLE or mark & TIGHT) and len(lattice.touched) > 0:
            _let_leave(search, lattice, costs, source)
    for index in range(len(sources)):
        source = sources[index]
        mark = np.int64(search.mark[source])
        if mark & STEP == 0:
            search.cost[source] = 0.0
            search.mark[source] = np.uint32(mark | OPEN | (NO_STEP + 1) << STEP_SHIFT)
            if len(cells) > 0:
                cells[source] = index
            put(search.queue, 0, source)


@inlined_kernel
def _passable_moves(search, lattice, costs, voxel, x, y, z):
    """Bits, by number of a move, of the neighbours that can be entered; looks at those not looked at yet."""
    size, moves, marks, number = lattice.size, lattice.moves, search.mark, search.searches[0]
    passable, fresh = 0, 0
    inner = 0 < x < size[0] - 1 and 0 < y < size[1] - 1 and lattice.layer >= 0
    if inner and len(moves) == _IN_LAYER:
        for k in range(_IN_LAYER):  # a number that the compiler knows: no loop, and no branch
            mark = np.int64(marks[voxel + moves[k].offset])
            passable |= np.int64(mark & KIND != IMPASSABLE) << k
            fresh |= np.int64(mark >> SEARCH_SHIFT != number) << k
    else:
        for k in range(len(moves)):
            step = moves[k].step
            at = (x + step[0], y + step[1], z + step[2])
            if 0 <= at[0] < size[0] and 0 <= at[1] < size[1] and 0 <= at[2] < size[2]:
                mark = np.int64(marks[voxel + moves[k].offset])
                passable |= np.int64(mark & KIND != IMPASSABLE) << k
                fresh |= np.int64(mark >> SEARCH_SHIFT != number) << k
    mark, k = np.int64(marks[voxel]), 0
    # Where the body fits here, only what it newly touches has to be looked at.
    fits = mark & KIND != IMPASSABLE and not mark & TIGHT
    while fresh >> k:
        if fresh >> k & 1:
            move = moves[k]
            near, step = voxel + move.offset, move.step
            at = (x + step[0], y + step[1], z + step[2])
            if fits and lattice.together == 1:
                kind = look_at(lattice, costs, near, at[0], at[1], at[2], move.first, move.last)
                marks[near] = np.uint32(number << SEARCH_SHIFT | kind)
            else:
                kind = mark_of(search, lattice, costs, near, at[0], at[1], at[2]) & KIND
            passable = passable & ~(1 << k) | np.int64(kind != IMPASSABLE) << k
        k += 1
    return passable


@inlined_kernel
def _step_on(search, lattice, costs, voxel, at, passable, goal, place, limit, per_cost, cells):
    """Reach the neighbours of a voxel, at (x, y, z), through it where that is cheaper.

    Returns:
        The limit of costs that are wanted: less if the goal was reached.
    """
    marks, cost, number = search.mark, search.cost, search.searches[0]
    here, rate = cost[voxel], rate_of(costs, voxel, np.int64(marks[voxel]))
    for move in lattice.moves:
        if passable & move.needs != move.needs:
            continue
        near = voxel + move.offset
        mark = np.int64(marks[near])
        if goal == _NOWHERE and mark & STEP and not mark & OPEN:
            continue  # its bucket was worked off: final, since no step is shorter than a bucket
        there = here + 0.5 * move.length * (rate + rate_of(costs, near, mark))
        before = math.inf
        if mark & STEP:
            before = cost[near]
            if there > before or (there == before and (len(cells) == 0 or cells[voxel] >= cells[near])):
                continue
        left = 0.0
        if goal != _NOWHERE:
            step = move.step
            left = costs.least_rate * _to_goal((at[0] + step[0], at[1] + step[1], at[2] + step[2]), place)
        if there + left >= limit:
            continue
        cost[near] = there
        if len(cells) > 0:
            cells[near] = cells[voxel]
        opened = mark & OPEN
        mark = number << SEARCH_SHIFT | (move.code + 1) << STEP_SHIFT | mark & (KIND | TIGHT)
        if near == goal:
            marks[near] = np.uint32(mark)
            limit = there
            continue
        marks[near] = np.uint32(mark | OPEN)
        bucket = int((there + left) * per_cost)
        if not opened or bucket < int((before + left) * per_cost):
            put(search.queue, bucket, near)
            if queue_full(search.queue):
                keep_entries(search.queue, marks, OPEN)
    return limit


@inlined_kernel
def _work_off(search, lattice, costs, goal, place, limit, per_cost, cells):
    """Step on from a block of the current bucket; returns the limit of costs that are wanted now."""
    marks, queue = search.mark, search.queue
    block, count = take_block(queue)
    for entry in range(count, 0, -1):
        voxel = np.int64(queue.blocks[block, entry])
        mark = np.int64(marks[voxel])
        if not mark & OPEN:
            continue
        x, y, z = place_of(lattice, voxel)
        ahead = search.cost[voxel]
        if goal != _NOWHERE:
            ahead += costs.least_rate * _to_goal((x, y, z), place)
        if int(ahead * per_cost) > queue.numbers[0].current:  # it was too far ahead for the ring
            put(queue, int(ahead * per_cost), voxel)
            continue
        marks[voxel] = np.uint32(mark ^ OPEN)
        if ahead >= limit:
            continue
        passable = _passable_moves(search, lattice, costs, voxel, x, y, z)
        limit = _step_on(
            search, lattice, costs, voxel, (x, y, z), passable, goal, place, limit, per_cost, cells
        )
    free_block(queue, block)
    return limit


@lean_kernel
def search_ways(search, lattice, costs, sources, goal, reach, cells):
    """Find the cheapest ways from the nearest of several sources to a goal, or to all voxels.

    Without a goal no step is shorter than a bucket is wide: who is worked off is final. With one, keys
    are costs plus the length still to go at the least rate, and a voxel to which a cheaper way is found
    later is worked off again; only what is on the found way is final.

    Sources may be impassable: a start inside a covered voxel may be left, and counts with the least
    rate. Of sources at the same cost the first one has the voxel.

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
    begin_search(search, lattice, costs, sources, cells)
    limit = np.nextafter(reach, math.inf)
    per_cost = _NARROWER**-1 / costs.least_rate
    place = (0, 0, 0)
    if goal != _NOWHERE:
        place = place_of(lattice, goal)
        mark = mark_of(search, lattice, costs, goal, place[0], place[1], place[2])
        if mark & STEP != 0:
            return 0.0
        if mark & KIND == IMPASSABLE:
            return math.inf
        per_cost *= _PER_STEP_TO_GOAL
    while go_on(search.queue) and search.queue.numbers[0].current <= limit * per_cost:
        limit = _work_off(search, lattice, costs, goal, place, limit, per_cost, cells)
    return cost_to(search, goal) if goal != _NOWHERE else 0.0


@lean_kernel
def widen_search(search, lattice, costs, reach, cells):
    """Go on with a search to all voxels, and find the cheapest ways to those within reach.

    Args:
        search: Of `begin_search` or an earlier call, and of nothing since. Costs over the reach, which
            `cost_to` gives of some voxels, are not final.
        lattice: As in the search.
        costs: As in the search.
        reach: Largest cost, no less than before; inf allowed.
        cells: As in the search.
    """
    per_cost, nowhere = _NARROWER**-1 / costs.least_rate, (0, 0, 0)
    while go_on(search.queue) and search.queue.numbers[0].current <= reach * per_cost:
        _work_off(search, lattice, costs, _NOWHERE, nowhere, math.inf, per_cost, cells)


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
