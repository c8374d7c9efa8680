"""Shortest paths between voxel centres through a belief, in voxel edges; exact (Dijkstra 1959; Hart 1968).

Steps and their costs are those of `lattice`. Voxels are classified only when the search comes near them, and
no array is cleared between searches: the time of a plan depends on what it searches, not on the world's size.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.bucket_queue import (
    BUCKET_WIDTH,
    advance,
    clear_queue,
    compact,
    free_block,
    pop_block,
    push,
    queue_full,
)
from entropy_explore_env.belief.paths.lattice import (
    DIAGONALS,
    FREE,
    IMPASSABLE,
    UNKNOWN,
    cell_of,
    classify_voxel,
    in_no_fly,
)
from entropy_explore_env.belief.paths.search import (
    KIND,
    NO_STEP,
    OPEN,
    SEARCH_SHIFT,
    STEP,
    STEP_SHIFT,
    TIGHT,
    begin_search,
    cost_per_edge,
    cost_to,
    mark_of,
)
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

ANY_GOAL = -1
"""As a goal: paths to all voxels are wanted."""

_BUCKETS_PER_STEP_TO_GOAL = 4.0
"""Buckets per cheapest step where there is a goal: fewer voxels are expanded twice."""

_SQRT2, _SQRT3 = DIAGONALS[1], DIAGONALS[2]


class _Query(NamedTuple):
    """What a search is for."""

    goal: int
    """Number of the voxel; ANY_GOAL = all voxels."""
    indices: tuple[int, int, int]
    """(x, y, z) of the goal."""
    per_cost: float
    """Buckets per unit of cost."""


@inlined_kernel
def _octile_distance(a, b):
    """Return the length of the shortest path by steps from indices (x, y, z) to others without obstacles."""
    x, y, z = abs(b[0] - a[0]), abs(b[1] - a[1]), abs(b[2] - a[2])
    longest, shortest = max(x, y, z), min(x, y, z)
    middle = x + y + z - longest - shortest
    return (longest - middle) + _SQRT2 * (middle - shortest) + _SQRT3 * shortest


@lean_kernel
def _open_exits(search, lattice, costs, voxel):
    """Let a body that does not fit where it starts leave through the uncovered voxels of its footprint."""
    number, grid, edge = search.searches[0], lattice.grid, lattice.edge
    x, y, z = grid_index(lattice.size, voxel)
    for offset in lattice.footprint:
        i, j, k = x * edge + offset[0], y * edge + offset[1], z * edge + offset[2]
        if 0 <= i < grid[0] and 0 <= j < grid[1] and 0 <= k < grid[2]:
            near, touched = cell_of(lattice, (i, j, k)), flat_index(grid, i, j, k)
            if near != voxel and (lattice.layer < 0 or k == lattice.layer):
                mark = mark_of(search, lattice, costs, near, i // edge, j // edge, k // edge)
                uncovered = costs.mean[touched] <= STOP_AT_COVERED and not in_no_fly(costs, touched)
                if mark & KIND == IMPASSABLE and uncovered:
                    kind = UNKNOWN if costs.precision[touched] < costs.known_precision else FREE
                    search.mark[near] = np.uint32(number << SEARCH_SHIFT | TIGHT | kind)


@lean_kernel
def start_search(search, lattice, costs, sources):
    """Start a new search: one to all voxels can then be continued step by step by `resume_search`.

    Arguments as of `search_paths`.
    """
    begin_search(search)
    clear_queue(search.queue)
    for source in sources:
        x, y, z = grid_index(lattice.size, source)
        mark = mark_of(search, lattice, costs, source, x, y, z)
        if (mark & KIND == IMPASSABLE or mark & TIGHT) and len(lattice.footprint) > 0:
            _open_exits(search, lattice, costs, source)
    for source in sources:
        mark = np.int64(search.mark[source])
        if mark & STEP == 0:
            search.cost[source] = 0.0
            search.mark[source] = np.uint32(mark | OPEN | (NO_STEP + 1) << STEP_SHIFT)
            push(search.queue, 0, source)


@inlined_kernel
def _bits(mark, number, k):
    """Return three masks with bit k set where a mark says passable, not classified yet, and final cost."""
    final = np.int64(mark & STEP != 0) & np.int64(mark & OPEN == 0)
    return np.int64(mark & KIND != IMPASSABLE) << k, np.int64(mark >> SEARCH_SHIFT != number) << k, final << k


@inlined_kernel
def _neighbours(search, lattice, costs, voxel, x, y, z):
    """Return bits, by number of a move, of the passable neighbours, and of those whose cost is final.

    Neighbours that are not classified yet are classified.
    """
    size, moves, marks, number = lattice.size, lattice.moves, search.mark, search.searches[0]
    passable, unclassified, settled = 0, 0, 0
    inner = 0 < x < size[0] - 1 and 0 < y < size[1] - 1 and (lattice.layer >= 0 or 0 < z < size[2] - 1)
    for k in range(len(moves)):
        step = moves[k].step
        x_to, y_to, z_to = x + step[0], y + step[1], z + step[2]
        if inner or (0 <= x_to < size[0] and 0 <= y_to < size[1] and 0 <= z_to < size[2]):
            bits = _bits(np.int64(marks[voxel + moves[k].offset]), number, k)
            passable, unclassified, settled = passable | bits[0], unclassified | bits[1], settled | bits[2]
    settled &= ~unclassified
    mark, k = np.int64(marks[voxel]), 0
    # Where the body fits here, only what it newly touches has to be checked.
    fits = mark & KIND != IMPASSABLE and not mark & TIGHT
    while unclassified >> k:
        if unclassified >> k & 1:
            move = moves[k]
            near, step = voxel + move.offset, move.step
            at = (x + step[0], y + step[1], z + step[2])
            if fits and lattice.block_voxels == 1 and lattice.edge == 1:
                kind = classify_voxel(lattice, costs, near, at[0], at[1], at[2], move.first, move.last)
                marks[near] = np.uint32(number << SEARCH_SHIFT | kind)
            else:
                kind = mark_of(search, lattice, costs, near, at[0], at[1], at[2]) & KIND
            passable = passable & ~(1 << k) | np.int64(kind != IMPASSABLE) << k
        k += 1
    return passable, settled


@inlined_kernel
def _relax_neighbours(search, lattice, costs, voxel, at, neighbours, query, max_cost):
    """Reach the neighbours of a voxel, at indices (x, y, z), through it where that is cheaper.

    `neighbours` is what `_neighbours` returned of it.

    Returns:
        The largest cost that is still of interest: less than `max_cost` if the goal was reached.
    """
    marks, cost, number = search.mark, search.cost, search.searches[0]
    here, per_edge = cost[voxel], cost_per_edge(lattice, costs, voxel, np.int64(marks[voxel]))
    passable, settled = neighbours
    left = passable
    if query.goal == ANY_GOAL:
        left &= ~settled  # their costs are final, since no step is shorter than a bucket
    for k in range(len(lattice.moves)):
        if not left >> k & 1:
            continue
        move = lattice.moves[k]
        if passable & move.needs != move.needs:
            continue
        near = voxel + move.offset
        mark = np.int64(marks[near])
        there = here + 0.5 * move.length * (per_edge + cost_per_edge(lattice, costs, near, mark))
        before = math.inf
        if mark & STEP:
            before = cost[near]
            if there >= before:
                continue
        to_go = 0.0
        if query.goal != ANY_GOAL:
            step = move.step
            indices = (at[0] + step[0], at[1] + step[1], at[2] + step[2])
            to_go = costs.min_per_edge * _octile_distance(indices, query.indices)
        if there + to_go >= max_cost:
            continue
        cost[near] = there
        queued = mark & OPEN
        mark = number << SEARCH_SHIFT | (move.code + 1) << STEP_SHIFT | mark & (KIND | TIGHT)
        if near == query.goal:
            marks[near] = np.uint32(mark)
            max_cost = there
            continue
        marks[near] = np.uint32(mark | OPEN)
        bucket = int((there + to_go) * query.per_cost)
        if not queued or bucket < int((before + to_go) * query.per_cost):
            push(search.queue, bucket, near)
            if queue_full(search.queue):
                compact(search.queue, marks, OPEN)
    return max_cost


@inlined_kernel
def _expand_block(search, lattice, costs, query, max_cost):
    """Expand the voxels of one block of the current bucket; returns the largest cost still of interest."""
    marks, queue = search.mark, search.queue
    block, count = pop_block(queue)
    for entry in range(count, 0, -1):
        voxel = np.int64(queue.blocks[block, entry])
        mark = np.int64(marks[voxel])
        if not mark & OPEN:
            continue
        x, y, z = grid_index(lattice.size, voxel)
        key = search.cost[voxel]
        if query.goal != ANY_GOAL:
            key += costs.min_per_edge * _octile_distance((x, y, z), query.indices)
        if int(key * query.per_cost) > queue.state[0].current:  # its key lay beyond the ring
            push(queue, int(key * query.per_cost), voxel)
            continue
        marks[voxel] = np.uint32(mark ^ OPEN)
        if key >= max_cost:
            continue
        neighbours = _neighbours(search, lattice, costs, voxel, x, y, z)
        max_cost = _relax_neighbours(search, lattice, costs, voxel, (x, y, z), neighbours, query, max_cost)
    free_block(queue, block)
    return max_cost


@lean_kernel
def search_paths(search, lattice, costs, sources, goal, max_cost):
    """Find the cheapest paths from the nearest of several sources to a goal, or to all voxels.

    Without a goal no step is shorter than a bucket is wide: a popped voxel's cost is final. With one, keys
    are costs plus a lower bound of the cost that remains (A*), and a voxel is expanded again if a cheaper
    path to it is found later; only the costs along the path to the goal are final.

    Sources may be impassable: a body may leave a covered voxel in which it starts, at the lowest traversal
    cost.

    Args:
        search: Filled in; read it by `cost_to` and `extract_path`.
        sources: (S,) int32, voxels.
        goal: A voxel; ANY_GOAL = all.
        max_cost: Paths that cost more are not found; inf allowed.

    Returns:
        Cost of reaching the goal, inf = not reached; without a goal 0.
    """
    start_search(search, lattice, costs, sources)
    limit = np.nextafter(max_cost, math.inf)
    per_cost = BUCKET_WIDTH**-1 / costs.min_per_edge
    indices = (0, 0, 0)
    if goal != ANY_GOAL:
        indices = grid_index(lattice.size, goal)
        mark = mark_of(search, lattice, costs, goal, indices[0], indices[1], indices[2])
        if mark & STEP != 0:
            return 0.0
        if mark & KIND == IMPASSABLE:
            return math.inf
        per_cost *= _BUCKETS_PER_STEP_TO_GOAL
    query = _Query(goal, indices, per_cost)
    while advance(search.queue) and search.queue.state[0].current <= limit * per_cost:
        limit = _expand_block(search, lattice, costs, query, limit)
    return cost_to(search, goal) if goal != ANY_GOAL else 0.0


@lean_kernel
def resume_search(search, lattice, costs, max_cost):
    """Continue a search to all voxels until the cheapest paths up to a cost are found.

    Args:
        search: As `start_search` or an earlier call left it. Costs above `max_cost`, which `cost_to` gives
            of some voxels, are not final.
        max_cost: No less than before; inf allowed.
    """
    query = _Query(ANY_GOAL, (0, 0, 0), BUCKET_WIDTH**-1 / costs.min_per_edge)
    while advance(search.queue) and search.queue.state[0].current <= max_cost * query.per_cost:
        _expand_block(search, lattice, costs, query, math.inf)
