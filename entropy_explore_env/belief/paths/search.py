"""Memory and result of a path search.

Nothing is cleared between searches: each voxel's mark carries the number of the search that wrote it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.bucket_queue import BucketQueue, new_queue
from entropy_explore_env.belief.paths.lattice import (
    IMPASSABLE,
    UNKNOWN,
    cell_of,
    classify_range,
    classify_voxel,
    standing_voxel,
)
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

# A voxel's mark: bits 0-1 its class, then flags, the step that led to it, and the number of the search.
KIND = 3
OPEN = 4
"""The voxel is in the queue."""
TIGHT = 8
"""The body does not fit here but overlaps this voxel at the start, so it may leave through it."""
STEP_SHIFT, STEP = 4, 31 << 4
"""Code of the step that led to the voxel, plus 1; 0 = not reached."""
SEARCH_SHIFT = 9
SEARCHES = 2**23 - 1
NO_STEP = 13
"""The code of a source's step: none led there."""
_NONE = -1


class Search(NamedTuple):
    """Memory and result of a search, for one search at a time.

    The system provides the memory of a voxel when a search first reaches it: 12 bytes, and the queue's.
    """

    cost: np.ndarray
    """(V,) float64, cost of reaching a voxel, where `mark` says that it was reached.

    Not float32: its rounding errors would add up step by step to more than 1e-6 of the cost.
    """
    mark: np.ndarray
    """(V,) uint32, laid out as above; out of date where the number of the search is another."""
    queue: BucketQueue
    searches: np.ndarray
    """(1,) int64, number of the latest search."""


def new_search(voxels: int) -> Search:
    """Return memory for searches in worlds of this many voxels."""
    return Search(
        np.empty(voxels, np.float64),
        np.zeros(voxels, np.uint32),
        new_queue(voxels + voxels // 8),
        np.zeros(1, np.int64),
    )


@inlined_kernel
def begin_search(search):
    """Forget what the latest search found."""
    search.searches[0] += 1
    if search.searches[0] > SEARCHES:  # once in millions of searches
        search.mark[:] = 0
        search.searches[0] = 1


@inlined_kernel
def mark_of(search, lattice, costs, voxel, x, y, z):
    """Mark of a voxel in this search; classifies the voxel, and its block, where that was not done."""
    mark, number = np.int64(search.mark[voxel]), search.searches[0]
    if mark >> SEARCH_SHIFT != number:
        if lattice.block_voxels > 1:
            first = voxel & -lattice.block_voxels
            last = min(first + lattice.block_voxels, len(search.mark))
            classify_range(costs, first, last, number << SEARCH_SHIFT, search.mark)
            mark = np.int64(search.mark[voxel])
        else:
            if lattice.edge == 1:
                kind = classify_voxel(lattice, costs, voxel, x, y, z, 0, len(lattice.footprint))
            else:
                kind = standing_voxel(lattice, costs, (x, y, z))[0]
            mark = number << SEARCH_SHIFT | kind
            search.mark[voxel] = np.uint32(mark)
    return mark


@inlined_kernel
def is_passable(mark):
    """Return whether the voxel of a mark can be entered."""
    return mark & KIND != IMPASSABLE


@inlined_kernel
def cost_per_edge(lattice, costs, voxel, mark):
    """Return the traversal cost of a voxel by its mark; that of an impassable start is the lower bound.

    Where cells are several voxels, a field of costs says no more than what is passable.
    """
    kind = mark & KIND
    if kind == IMPASSABLE:
        return costs.min_per_edge
    if len(costs.per_edge) > 0 and lattice.edge == 1:
        return np.float64(costs.per_edge[voxel])
    return costs.unknown_cost if kind == UNKNOWN else 1.0


@inlined_kernel
def cost_to(search, voxel):
    """Return the cost of reaching a voxel in the latest search; inf = not reached."""
    mark = np.int64(search.mark[voxel])
    reached = mark >> SEARCH_SHIFT == search.searches[0] and mark & STEP != 0
    return search.cost[voxel] if reached else math.inf


@inlined_kernel
def length_to(search, lattice, costs, voxel):
    """Return the cost, in voxel edges, of the path to a voxel, at indices (x, y, z) of the grid; inf = none.

    It is the cost of the path to the voxel's cell. Where cells are larger than voxels, voxels in which the
    body does not fit are not reached.
    """
    cost = cost_to(search, cell_of(lattice, voxel))
    if lattice.edge == 1 or math.isinf(cost):
        return cost
    number, body = flat_index(lattice.grid, voxel[0], voxel[1], voxel[2]), len(lattice.footprint)
    kind = classify_voxel(lattice, costs, number, voxel[0], voxel[1], voxel[2], 0, body)
    return math.inf if kind == IMPASSABLE else lattice.edge * cost


@inlined_kernel
def _predecessor(search, lattice, voxel):
    """Return the voxel from which a reached one was reached; -1 = the voxel is a source."""
    code = ((np.int64(search.mark[voxel]) & STEP) >> STEP_SHIFT) - 1
    if code == NO_STEP:
        return _NONE
    column = (code // 9 - 1) * lattice.size[1] + code // 3 % 3 - 1
    return voxel - column * lattice.size[2] - code % 3 + 1


@lean_kernel
def extract_path(search, lattice, voxel, path):
    """Write down the path that the latest search found to a voxel.

    Args:
        voxel: Where the path ends.
        path: (N,) int32, filled with the voxels from the source to `voxel`, both included, if they fit.

    Returns:
        Number of voxels of the path; 0 = the voxel was not reached. More than N: nothing was written.
    """
    if math.isinf(cost_to(search, voxel)):
        return 0
    count, at = 1, voxel
    while _predecessor(search, lattice, at) != _NONE:
        at = _predecessor(search, lattice, at)
        count += 1
    if count <= len(path):
        at = voxel
        for index in range(count - 1, -1, -1):
            path[index] = at
            at = _predecessor(search, lattice, at)
    return count
