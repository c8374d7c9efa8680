"""Frontiers of a height field below an exposure surface (Sawhney 2009).

Points are columns. A column is explored once the voxel of its surface is: the highest one that is known and
believed covered, with a known free voxel above it. Robots may be between the ground and the exposure surface
of explored columns, whether or not a ray went through that air. On the edge lie explored columns beside
unexplored ones (see voxel/map.py). Each block of columns is represented by the candidate nearest to its
middle, at several heights (sect. 3.2). Grid units: heights are in layers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.frontiers.voxel_map import (
    CANDIDATE,
    COVERED,
    EDGE,
    NONE,
    UNEXPLORED,
    UNMAPPED,
    new_frontier_map,
    queue_block,
    state_of,
)

TILE = 8
"""Width in columns of the square tiles by which changes are noted."""


class TerrainMap(NamedTuple):
    """What is read off one robot's belief of a height field; B blocks of columns, H heights each."""

    state: np.ndarray
    """(V,) uint8, flags as in a FrontierMap."""
    excluded: np.ndarray
    """(V,) uint8, EXCLUDED where a scan was taken."""
    ground: np.ndarray
    """(X, Y) int32, solid layers of a mapped column; NONE = not mapped."""
    unexplored: np.ndarray
    """(X·Y,) uint8, whether a column's surface is unexplored at the level that counts now."""
    flags: np.ndarray
    """(X·Y,) uint8: EDGE, CANDIDATE."""
    traversal_cost: np.ndarray
    """(V,) float32, 1 where the body may be, else inf."""
    column: np.ndarray
    """(B,) int32, the candidate column of a block; NONE = it has none."""
    voxel: np.ndarray
    """(B·H,) int32, its candidates; NONE = none at this height."""
    seen: np.ndarray
    """(B·H,) float32, points that can be seen from it; inf = not counted since a change nearby."""
    dirty: np.ndarray
    """(B,) uint8, whether a block has to be updated."""
    queued: np.ndarray
    """(B,) int32, the blocks that have to be updated."""
    changed: np.ndarray
    """(X / TILE, Y / TILE) uint8, where ground was found."""
    ceiling: np.ndarray
    """(X, Y) int32, lowest layer of the no-fly zone."""
    size: tuple[int, int, int]
    spacing: int
    rise: int
    """Layers between two candidates above each other."""
    heights: int
    """H."""
    rows: int
    """Blocks along y."""
    footprint: np.ndarray
    """(N, 3) int64 index offsets of the voxels that the body touches."""
    reach: int
    """Largest of these offsets."""


def new_terrain_map(
    shape: tuple[int, int, int], body_radius: float, spacing: int, rise: int, ceiling: np.ndarray
) -> TerrainMap:
    """A map of which nothing is explored; arguments as of `new_frontier_map`."""
    footprint = new_frontier_map((3, 3, 3), body_radius, None, 1).footprint
    columns, voxels, heights = shape[0] * shape[1], math.prod(shape), math.ceil(shape[2] / rise)
    rows = math.ceil(shape[1] / spacing)
    count = math.ceil(shape[0] / spacing) * rows
    return TerrainMap(
        state=np.full(voxels, UNEXPLORED | UNMAPPED, np.uint8),
        excluded=np.zeros(voxels, np.uint8),
        ground=np.full(shape[:2], NONE, np.int32),
        unexplored=np.ones(columns, np.uint8),
        flags=np.zeros(columns, np.uint8),
        traversal_cost=np.full(voxels, np.inf, np.float32),
        column=np.full(count, NONE, np.int32),
        voxel=np.full(count * heights, NONE, np.int32),
        seen=np.full(count * heights, np.inf, np.float32),
        dirty=np.zeros(count, np.uint8),
        queued=np.zeros(count, np.int32),
        changed=np.zeros((shape[0] // TILE + 1, shape[1] // TILE + 1), np.uint8),
        ceiling=np.ascontiguousarray(ceiling, np.int32).copy(),
        size=(int(shape[0]), int(shape[1]), int(shape[2])),
        spacing=spacing,
        rise=rise,
        heights=heights,
        rows=rows,
        footprint=footprint,
        reach=int(np.abs(footprint).max()),
    )


@inlined_kernel
def _differs(state, mean, precision, levels, first, last):
    """Whether the flags of voxels `first` … `last` - 1 are not those of the belief."""
    different = np.uint8(0)
    for voxel in range(first, last):
        different |= state[voxel] ^ state_of(mean[voxel], precision[voxel], levels)
    return different != 0


@lean_kernel
def update_terrain(terrain, mean, precision, levels):
    """Bring the map up to date with a belief, voxel by voxel; arguments as of `update_frontiers`."""
    size, count = terrain.size, 0
    for column in range(size[0] * size[1]):
        first, last = column * size[2], (column + 1) * size[2]
        if _differs(terrain.state, mean, precision, levels, first, last):
            for voxel in range(first, last):
                terrain.state[voxel] = state_of(mean[voxel], precision[voxel], levels)
            x, y = column // size[1], column % size[1]
            if find_ground(terrain, x, y):
                terrain.changed[x // TILE, y // TILE] = 1
            count = _queue_around(terrain, x, y, terrain.reach + 2, count)
    update_columns(terrain, count)


@lean_kernel
def update_columns(terrain, count):
    """Find the edge, the free space and the candidates of the queued blocks."""
    for place in range(count):
        _mark_edge(terrain, terrain.queued[place])
    for place in range(count):
        _choose_candidates(terrain, terrain.queued[place])
        terrain.dirty[terrain.queued[place]] = 0


@lean_kernel
def _queue_around(terrain, x, y, reach, count):
    """Queue the blocks that have a column within `reach` along both axes."""
    size, wide = terrain.size, terrain.spacing
    for i in range(max(x - reach, 0) // wide, min(x + reach, size[0] - 1) // wide + 1):
        for j in range(max(y - reach, 0) // wide, min(y + reach, size[1] - 1) // wide + 1):
            count = queue_block(terrain, i * terrain.rows + j, count)
    return count


@lean_kernel
def find_ground(terrain, x, y):
    """Find a column's ground from its voxels' states; returns whether its state changed."""
    size, state = terrain.size, terrain.state
    column = x * size[1] + y
    ground, unexplored = NONE, 1
    for layer in range(size[2] - 1, -1, -1):
        voxel = column * size[2] + layer
        if state[voxel] & COVERED and state[voxel] & UNMAPPED == 0:
            clear = layer == size[2] - 1 or state[voxel + 1] & (UNMAPPED | COVERED) == 0
            if clear:
                ground = layer + 1
                unexplored = 1 if state[voxel] & UNEXPLORED else 0
            break
    different = ground != terrain.ground[x, y] or unexplored != terrain.unexplored[column]
    terrain.ground[x, y], terrain.unexplored[column] = ground, unexplored
    return different


@inlined_kernel
def _span(terrain, block):
    """First column of a block along x and y, and one past its last."""
    i, j, wide = block // terrain.rows, block % terrain.rows, terrain.spacing
    return i * wide, min((i + 1) * wide, terrain.size[0]), j * wide, min((j + 1) * wide, terrain.size[1])


@inlined_kernel
def _apart(terrain, block, x, y):
    """Squared distance, in half columns, of a column from the middle of its block."""
    i0, i1, j0, j1 = _span(terrain, block)
    dx, dy = 2 * x + 1 - i0 - i1, 2 * y + 1 - j0 - j1
    return dx * dx + dy * dy


@lean_kernel
def _mark_edge(terrain, block):
    """Set EDGE in a block: mapped columns that are, or are beside, unexplored ones."""
    size, ground, unexplored = terrain.size, terrain.ground, terrain.unexplored
    i0, i1, j0, j1 = _span(terrain, block)
    for x in range(i0, i1):
        for y in range(j0, j1):
            column = x * size[1] + y
            terrain.flags[column] &= CANDIDATE
            if ground[x, y] == NONE:
                continue
            found = unexplored[column] > 0
            found |= x > 0 and unexplored[column - size[1]] > 0
            found |= x < size[0] - 1 and unexplored[column + size[1]] > 0
            found |= y > 0 and unexplored[column - 1] > 0
            found |= y < size[1] - 1 and unexplored[column + 1] > 0
            if found:
                terrain.flags[column] |= EDGE


@lean_kernel
def may_fly(terrain, x, y, z):
    """Whether a body's footprint is above mapped ground, below the ceiling and not covered."""
    size = terrain.size
    for offset in terrain.footprint:
        i, j, k = x + offset[0], y + offset[1], z + offset[2]
        if not (0 <= i < size[0] and 0 <= j < size[1] and 0 <= k < size[2]):
            return False
        ground = terrain.ground[i, j]
        if ground == NONE or k < ground or k >= terrain.ceiling[i, j]:
            return False
        if terrain.state[flat_index(size, i, j, k)] & COVERED:
            return False
    return True


@lean_kernel
def _choose_candidates(terrain, block):
    """Set traversal costs and CANDIDATE in a block, choose its column, and the heights above it."""
    size = terrain.size
    i0, i1, j0, j1 = _span(terrain, block)
    best, nearest = NONE, math.inf
    for x in range(i0, i1):
        for y in range(j0, j1):
            column = x * size[1] + y
            for z in range(size[2]):
                terrain.traversal_cost[column * size[2] + z] = 1.0 if may_fly(terrain, x, y, z) else math.inf
            terrain.flags[column] &= EDGE
            if _near_edge(terrain, x, y) and _has_room(terrain, column):
                terrain.flags[column] |= CANDIDATE
                apart = _apart(terrain, block, x, y)
                if apart < nearest:
                    best, nearest = column, apart
    _take_column(terrain, block, best)


@inlined_kernel
def _at_height(terrain, column, height):
    """The voxel at a height of the candidates above a column; NONE where a body cannot be, or has scanned."""
    layer = terrain.ground[column // terrain.size[1], column % terrain.size[1]] + 1 + height * terrain.rise
    if layer >= terrain.size[2]:
        return NONE
    voxel = column * terrain.size[2] + layer
    return NONE if math.isinf(terrain.traversal_cost[voxel]) or terrain.excluded[voxel] else voxel


@inlined_kernel
def _has_room(terrain, column):
    """Whether there is a candidate above a column."""
    if terrain.ground[column // terrain.size[1], column % terrain.size[1]] == NONE:
        return False
    for height in range(terrain.heights):
        if _at_height(terrain, column, height) != NONE:
            return True
    return False


@lean_kernel
def _take_column(terrain, block, column):
    """Set the candidate column of a block, or NONE, and its candidates."""
    changed = column != terrain.column[block]
    terrain.column[block] = column
    for height in range(terrain.heights):
        place = block * terrain.heights + height
        voxel = _at_height(terrain, column, height) if column != NONE else NONE
        if changed or voxel != terrain.voxel[place]:
            terrain.voxel[place] = voxel
            terrain.seen[place] = math.inf


@lean_kernel
def choose_reached_columns(terrain, cost):
    """Choose another column for blocks whose candidates no path reaches; (V,) path costs, inf = none."""
    size = terrain.size
    for block in range(len(terrain.column)):
        if terrain.column[block] == NONE or _is_reached(terrain, terrain.column[block], cost):
            continue
        i0, i1, j0, j1 = _span(terrain, block)
        best, nearest = NONE, math.inf
        for x in range(i0, i1):
            for y in range(j0, j1):
                column, apart = x * size[1] + y, _apart(terrain, block, x, y)
                wanted = terrain.flags[column] & CANDIDATE and apart < nearest
                if wanted and _is_reached(terrain, column, cost):
                    best, nearest = column, apart
        if best != NONE:
            _take_column(terrain, block, best)


@inlined_kernel
def _is_reached(terrain, column, cost):
    """Whether a candidate above a column was reached."""
    for height in range(terrain.heights):
        voxel = _at_height(terrain, column, height)
        if voxel != NONE and not math.isinf(cost[voxel]):
            return True
    return False


@inlined_kernel
def _near_edge(terrain, x, y):
    """Whether a column of the edge is within the body's reach of this one."""
    size, reach = terrain.size, terrain.reach
    for i in range(max(x - reach, 0), min(x + reach, size[0] - 1) + 1):
        for j in range(max(y - reach, 0), min(y + reach, size[1] - 1) + 1):
            if terrain.flags[i * size[1] + j] & EDGE:
                return True
    return False


@lean_kernel
def reset_bounds(changed, size, voxels, seen, reach):
    """Reset the counts of candidates within reach of a changed tile, and clear the changes.

    Args:
        changed: (TX, TY) uint8, cleared.
        size: (X, Y, Z) voxels.
        voxels: (B,) int32 candidates, NONE = none.
        seen: (B,) float32, set to inf.
        reach: In voxel edges, at most as far as the grid is wide.
    """
    some = False
    for i in range(changed.shape[0]):
        for j in range(changed.shape[1]):
            some = some or changed[i, j] > 0
    if not some:
        return
    wide = int(min(reach, size[0] + size[1])) + 1
    for place in range(len(voxels)):
        if voxels[place] == NONE or math.isinf(seen[place]):
            continue
        column = voxels[place] // size[2]
        x, y = column // size[1], column % size[1]
        for i in range(max(x - wide, 0) // TILE, min((x + wide) // TILE, changed.shape[0] - 1) + 1):
            for j in range(max(y - wide, 0) // TILE, min((y + wide) // TILE, changed.shape[1] - 1) + 1):
                if changed[i, j]:
                    seen[place] = math.inf
    for i in range(changed.shape[0]):
        for j in range(changed.shape[1]):
            changed[i, j] = 0
