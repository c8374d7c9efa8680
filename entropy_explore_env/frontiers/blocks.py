"""Where the mapped space of one robot ends, and one candidate for each block of cells.

A cell is a voxel or a column of ground, in one of `voxel_states`. The edge (Yamauchi 1998) consists of mapped
free cells next to unexplored ones; at a finer level also of mapped cells that are unexplored themselves. A
candidate is a cell that has room and whose footprint meets the edge; the one nearest to the middle of its
block represents it. Cells are known by number, C order; lengths are in cells. `blocks` is always a Blocks.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.frontiers.voxel_states import COVERED, UNEXPLORED, UNMAPPED

EDGE = 1
"""Mapped and free, and itself unexplored at the level that counts now, or beside such a cell."""
CANDIDATE = 2
EXCLUDED = 4
"""A scan was taken here: no candidate any more."""
DROPPED = 8
"""An edge that a scan from beside it did not explore: nothing beside it alone is a candidate."""
ROOM = 16
"""A robot may scan from here, and has not yet."""
COUNTED_FREE = 32
"""Mapped and free, and counted as such in `Blocks.free`."""
COUNTED_EDGE = 64
"""An EDGE that is not DROPPED, and counted as such in `Blocks.met`."""
_ALL_FLAGS = 127
FIND_CANDIDATES = 1
"""A block's candidates have to be found again."""
FIND_EDGES = 2
"""A block's edges and candidates have to be found again."""
NONE = -1
"""In place of the number of a cell or voxel: there is none."""
_NO_COSTS = np.zeros(0)


class Blocks(NamedTuple):
    """N cells in B blocks, and the candidate of each block."""

    state: np.ndarray
    """(N,) uint8: UNEXPLORED, UNMAPPED, COVERED; kept up to date by others."""
    flags: np.ndarray
    """(N,) uint8: EDGE, CANDIDATE, EXCLUDED, DROPPED, ROOM, COUNTED_FREE, COUNTED_EDGE."""
    free: np.ndarray
    """(N,) uint16 or uint32, how many of the cells that a body in each cell touches are mapped and free; kept
    up to date by others. (0,) in plans and layers, where footprints are small enough to be looked through."""
    met: np.ndarray
    """(N,), or (0,), as `free`: how many of these cells are an EDGE that is not DROPPED."""
    candidate: np.ndarray
    """(B,) int32, cell; NONE = no cell of the block is a CANDIDATE."""
    edges: np.ndarray
    """(B,) uint8, whether a block holds an EDGE."""
    dirty: np.ndarray
    """(B,) uint8, what has to be found again: 0, FIND_CANDIDATES or FIND_EDGES."""
    size: tuple[int, int, int]
    """Cells along each axis."""
    across: tuple[int, int, int]
    """Cells of a block along each axis."""
    blocks: tuple[int, int, int]
    """Blocks along each axis."""
    footprint: np.ndarray
    """(F, 3) int64 index offsets of the cells that a body touches; its own first."""
    columns: np.ndarray
    """(C, 4) int64, the footprint as columns: offsets along x and y, lowest and highest offset along z."""
    reach: int
    """Largest of these offsets."""
    layer: int
    """The only layer with candidates (planar robots); -1 = all."""


def new_blocks(
    shape: tuple[int, ...], state: np.ndarray, footprint: np.ndarray, layer: int | None, spacing: int
) -> Blocks:
    """Return blocks of `spacing` cells along each axis, without a candidate; see `Blocks`."""
    flat = shape[2] == 1 or layer is not None
    across = (spacing, spacing, int(shape[2]) if flat else spacing)
    blocks = [math.ceil(n / width) for n, width in zip(shape, across, strict=True)]
    counted, count_type = 0 if flat else len(state), np.uint16 if len(footprint) < 1 << 16 else np.uint32
    return Blocks(
        state=state,
        flags=np.zeros(len(state), np.uint8),
        free=np.zeros(counted, count_type),
        met=np.zeros(counted, count_type),
        candidate=np.full(math.prod(blocks), NONE, np.int32),
        edges=np.zeros(math.prod(blocks), np.uint8),
        dirty=np.zeros(math.prod(blocks), np.uint8),
        size=(int(shape[0]), int(shape[1]), int(shape[2])),
        across=across,
        blocks=(blocks[0], blocks[1], blocks[2]),
        footprint=footprint,
        columns=_columns(footprint),
        reach=int(np.abs(footprint).max(initial=0)),
        layer=-1 if layer is None else int(layer),
    )


def _columns(footprint: np.ndarray) -> np.ndarray:
    """Return (C, 4) int64 columns of a footprint, none of which has a gap: see `Blocks`."""
    across, column = np.unique(footprint[:, :2], axis=0, return_inverse=True)
    low, high = np.zeros(len(across), np.int64), np.zeros(len(across), np.int64)
    np.minimum.at(low, column.reshape(-1), footprint[:, 2])
    np.maximum.at(high, column.reshape(-1), footprint[:, 2])
    return np.column_stack([across, low, high])


@inlined_kernel
def _blocks_near(blocks, low, high, radius):
    """Return (first, last): block indices within `radius` of a span of cells; `last` is one past them.

    The span leads from the cell `low` up to but without `high`, along every axis.
    """
    size, across = blocks.size, blocks.across
    first = (
        max(low[0] - radius, 0) // across[0],
        max(low[1] - radius, 0) // across[1],
        max(low[2] - radius, 0) // across[2],
    )
    last = (
        min(high[0] - 1 + radius, size[0] - 1) // across[0] + 1,
        min(high[1] - 1 + radius, size[1] - 1) // across[1] + 1,
        min(high[2] - 1 + radius, size[2] - 1) // across[2] + 1,
    )
    return first, last


@lean_kernel
def mark_around(blocks, cell, radius, wanted):
    """Mark the blocks with a cell within `radius` along every axis: FIND_CANDIDATES or FIND_EDGES."""
    x, y, z = grid_index(blocks.size, cell)
    first, last = _blocks_near(blocks, (x, y, z), (x + 1, y + 1, z + 1), radius)
    for i in range(first[0], last[0]):
        for j in range(first[1], last[1]):
            for k in range(first[2], last[2]):
                block = flat_index(blocks.blocks, i, j, k)
                blocks.dirty[block] = max(blocks.dirty[block], wanted)


@lean_kernel
def mark_changed(blocks, cell):
    """Mark the blocks whose edges or candidates depend on the state of a cell."""
    mark_around(blocks, cell, blocks.reach + 2, FIND_CANDIDATES)
    mark_around(blocks, cell, 1, FIND_EDGES)


@inlined_kernel
def block_span(blocks, block):
    """Return the first cell of a block along each axis, and one past its last."""
    size, across = blocks.size, blocks.across
    i, j, k = grid_index(blocks.blocks, block)
    low, high = k * across[2], min((k + 1) * across[2], size[2])
    if blocks.layer >= 0:
        low, high = blocks.layer, blocks.layer + 1
    return (
        (i * across[0], j * across[1], low),
        (min((i + 1) * across[0], size[0]), min((j + 1) * across[1], size[1]), high),
    )


@inlined_kernel
def cell_at(size, x, y, z):
    """Return the number of a cell; NONE = outside."""
    if 0 <= x < size[0] and 0 <= y < size[1] and 0 <= z < size[2]:
        return flat_index(size, x, y, z)
    return NONE


@inlined_kernel
def shares_face(blocks, marks, mask, value, x, y, z):
    """Return whether a cell's neighbour (of planar robots, in the layer) has a value in masked (N,) marks."""
    size, cell = blocks.size, flat_index(blocks.size, x, y, z)
    row, column = size[2], size[1] * size[2]
    return (
        (x > 0 and marks[cell - column] & mask == value)
        or (x < size[0] - 1 and marks[cell + column] & mask == value)
        or (y > 0 and marks[cell - row] & mask == value)
        or (y < size[1] - 1 and marks[cell + row] & mask == value)
        or (blocks.layer < 0 and z > 0 and marks[cell - 1] & mask == value)
        or (blocks.layer < 0 and z < size[2] - 1 and marks[cell + 1] & mask == value)
    )


@inlined_kernel
def set_flag(blocks, cell, flag, value):
    """Set or clear a flag of a cell."""
    blocks.flags[cell] = blocks.flags[cell] & (_ALL_FLAGS - flag) | (flag if value else 0)


@lean_kernel
def count_for_bodies(blocks, counts, cell, flag, counted):
    """Count a cell, or no longer, in all cells from which a body touches it.

    Args:
        blocks: Its flags are changed.
        counts: (N,), changed.
        cell: Its number.
        flag: Set while the cell is counted.
        counted: Whether it counts now.
    """
    if counted == (blocks.flags[cell] & flag > 0):
        return
    set_flag(blocks, cell, flag, counted)
    change, size = 1 if counted else -1, blocks.size
    x, y, z = grid_index(size, cell)
    for column in blocks.columns:
        i, j = x - column[0], y - column[1]
        if 0 <= i < size[0] and 0 <= j < size[1]:
            first, last = max(z - column[3], 0), min(z - column[2], size[2] - 1)
            near = flat_index(size, i, j, first)
            for at in range(near, near + last - first + 1):
                counts[at] += change


@lean_kernel
def mark_edges(blocks):
    """Set EDGE in the blocks whose edges have to be found again."""
    state = blocks.state
    for block in range(len(blocks.dirty)):
        if blocks.dirty[block] != FIND_EDGES:
            continue
        blocks.edges[block] = 0
        low, high = block_span(blocks, block)
        for x in range(low[0], high[0]):
            for y in range(low[1], high[1]):
                for z in range(low[2], high[2]):
                    cell = flat_index(blocks.size, x, y, z)
                    edge = state[cell] & (UNMAPPED | COVERED) == 0 and (
                        state[cell] & UNEXPLORED > 0
                        or shares_face(blocks, state, UNEXPLORED, UNEXPLORED, x, y, z)
                    )
                    set_flag(blocks, cell, EDGE, edge)
                    if edge:
                        blocks.edges[block] = 1
                    if len(blocks.met) > 0:
                        counts = edge and blocks.flags[cell] & DROPPED == 0
                        count_for_bodies(blocks, blocks.met, cell, COUNTED_EDGE, counts)


@lean_kernel
def choose_candidate(blocks, block):
    """Set CANDIDATE in a block and choose the block's candidate, for which edges and ROOM are known."""
    blocks.dirty[block] = 0
    low, high = block_span(blocks, block)
    if blocks.candidate[block] == NONE and not _edges_near(blocks, low, high):
        return
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            for z in range(low[2], high[2]):
                cell = flat_index(blocks.size, x, y, z)
                chosen = blocks.flags[cell] & ROOM and _meets_edge(blocks, x, y, z)
                set_flag(blocks, cell, CANDIDATE, chosen)
    blocks.candidate[block] = _nearest_to_middle(blocks, block, _NO_COSTS)


@lean_kernel
def _edges_near(blocks, low, high):
    """Return whether any block that a body touches from the cells of a span holds an EDGE, DROPPED or not."""
    first, last = _blocks_near(blocks, low, high, blocks.reach)
    for i in range(first[0], last[0]):
        for j in range(first[1], last[1]):
            for k in range(first[2], last[2]):
                if blocks.edges[flat_index(blocks.blocks, i, j, k)]:
                    return True
    return False


@inlined_kernel
def _meets_edge(blocks, x, y, z):
    """Return whether the footprint in a cell meets the edge."""
    if len(blocks.met) > 0:
        return blocks.met[flat_index(blocks.size, x, y, z)] > 0
    for offset in blocks.footprint:
        near = cell_at(blocks.size, x + offset[0], y + offset[1], z + offset[2])
        if near != NONE and blocks.flags[near] & (EDGE | DROPPED) == EDGE:
            return True
    return False


@lean_kernel
def _nearest_to_middle(blocks, block, cost):
    """Return the CANDIDATE cell nearest to the middle of its block to which a path leads; NONE = none.

    (N,) float64 path costs are inf where no path leads; with (0,) paths do not matter.
    """
    low, high = block_span(blocks, block)
    middle = (low[0] + high[0], low[1] + high[1], low[2] + high[2])
    best, nearest = NONE, math.inf
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            for z in range(low[2], high[2]):
                cell = flat_index(blocks.size, x, y, z)
                if blocks.flags[cell] & CANDIDATE and (len(cost) == 0 or not math.isinf(cost[cell])):
                    dx, dy, dz = 2 * x + 1 - middle[0], 2 * y + 1 - middle[1], 2 * z + 1 - middle[2]
                    apart = dx * dx + dy * dy + dz * dz
                    if apart < nearest:
                        best, nearest = cell, apart
    return best


@lean_kernel
def replace_unreached(blocks, cost):
    """Choose other candidates where no path leads to a block's; (N,) float64 path costs, inf = no path."""
    for block in range(len(blocks.candidate)):
        if blocks.candidate[block] != NONE and math.isinf(cost[blocks.candidate[block]]):
            reached = _nearest_to_middle(blocks, block, cost)
            if reached != NONE:
                blocks.candidate[block] = reached
