"""Working space and result of a search through a belief, never cleared: marks carry the search's number."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.bucket_queue import BucketQueue, new_queue
from entropy_explore_env.belief.paths.lattice import IMPASSABLE, UNKNOWN, look_along, look_at
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

# A voxel's mark: bits 0-1 what can be done in it, then flags, the step that led to it, the search.
KIND = 3
OPEN = 4
"""It waits in the queue."""
TIGHT = 8
"""The body does not fit, but touches the voxel from the start: it may leave through it."""
STEP_SHIFT, STEP = 4, 31 << 4
"""Code of the step that led to the voxel, plus 1; 0 = not reached."""
SEARCH_SHIFT = 9
SEARCHES = 2**23 - 1
NO_STEP = 13
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
    """Mark of a voxel in this search; looks at it, and at some beside it, if that was not done."""
    mark, number = np.int64(search.mark[voxel]), search.searches[0]
    if mark >> SEARCH_SHIFT != number:
        if lattice.together > 1:
            first = voxel & -lattice.together
            last = min(first + lattice.together, len(search.mark))
            look_along(costs, first, last, number << SEARCH_SHIFT, search.mark)
            mark = np.int64(search.mark[voxel])
        else:
            kind = look_at(lattice, costs, voxel, x, y, z, 0, len(lattice.touched))
            mark = number << SEARCH_SHIFT | kind
            search.mark[voxel] = np.uint32(mark)
    return mark


@inlined_kernel
def is_passable(mark):
    """Whether the voxel of a mark can be entered."""
    return mark & KIND != IMPASSABLE


@inlined_kernel
def rate_of(costs, voxel, mark):
    """Cost of a voxel edge of way through a voxel; the least rate in a start that is impassable."""
    kind = mark & KIND
    if kind == IMPASSABLE:
        return costs.least_rate
    if len(costs.rates) > 0:
        return np.float64(costs.rates[voxel])
    return costs.unknown_cost if kind == UNKNOWN else 1.0


@inlined_kernel
def cost_to(search, voxel):
    """Cost of a voxel in the latest search; inf = not reached."""
    mark = np.int64(search.mark[voxel])
    reached = mark >> SEARCH_SHIFT == search.searches[0] and mark & STEP != 0
    return search.cost[voxel] if reached else math.inf


@inlined_kernel
def _before(search, lattice, voxel):
    """The voxel from which a reached one was reached; -1 = it is a source."""
    code = ((np.int64(search.mark[voxel]) & STEP) >> STEP_SHIFT) - 1
    if code == NO_STEP:
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
