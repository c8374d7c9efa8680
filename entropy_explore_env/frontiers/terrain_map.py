"""The frontier of a height field below an exposure surface (Sawhney 2009).

Points are columns. A column is explored once the voxel of its surface is: the highest one that is known and
believed covered, with a known free voxel above it. Robots may be between the ground and the exposure surface
of explored columns, whether or not a ray went through that air. Columns lie in blocks as cells do; the one
that represents a block has candidates at several heights (sect. 3.2). Grid units: heights are in layers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.frontiers.blocks import (
    CANDIDATE,
    COVERED,
    NONE,
    ROOM,
    UNEXPLORED,
    UNMAPPED,
    Blocks,
    block_span,
    choose_candidate,
    mark_around,
    mark_edges,
    new_blocks,
    set_flag,
)
from entropy_explore_env.frontiers.voxel_map import body_footprint
from entropy_explore_env.frontiers.voxel_states import VoxelStates, new_states, note_opened, update_states


class TerrainMap(NamedTuple):
    """What is read off one robot's belief of a height field; B blocks of columns, H heights each."""

    states: VoxelStates
    columns: Blocks
    """Of which a column's state is that of its surface, UNEXPLORED and UNMAPPED where it has none."""
    ground: np.ndarray
    """(X, Y) int32, solid layers of a mapped column; NONE = not mapped."""
    excluded: np.ndarray
    """(V,) uint8, EXCLUDED where a scan was taken."""
    traversal_cost: np.ndarray
    """(V,) float32, 1 where the body may be, else inf."""
    voxel: np.ndarray
    """(B, H) int32, candidates; NONE = none at this height."""
    ceiling: np.ndarray
    """(X, Y) int32, lowest layer of the no-fly zone."""
    size: tuple[int, int, int]
    rise: int
    """Layers between two candidates above each other."""
    footprint: np.ndarray
    """(N, 3) int64 index offsets of the voxels that the body touches."""


def new_terrain_map(
    shape: tuple[int, int, int], body_radius: float, spacing: int, ceiling: np.ndarray
) -> TerrainMap:
    """Return a map of which nothing is explored.

    Args:
        shape: (X, Y, Z) voxels.
        body_radius: In voxel edges.
        spacing: Voxels between candidates, along all axes.
        ceiling: (X, Y) lowest layer of the no-fly zone.
    """
    footprint, states = body_footprint((3, 3, 3), body_radius, None), new_states(shape)
    reach, voxels = int(np.abs(footprint).max()), math.prod(shape)
    square = np.array([(x, y, 0) for x in range(-reach, reach + 1) for y in range(-reach, reach + 1)])
    state = np.full(shape[0] * shape[1], UNEXPLORED | UNMAPPED, np.uint8)
    columns = new_blocks((*shape[:2], 1), state, square, 0, spacing)
    return TerrainMap(
        states=states,
        columns=columns,
        ground=np.full(shape[:2], NONE, np.int32),
        excluded=np.zeros(voxels, np.uint8),
        traversal_cost=np.full(voxels, np.inf, np.float32),
        voxel=np.full((len(columns.candidate), math.ceil(shape[2] / spacing)), NONE, np.int32),
        ceiling=np.ascontiguousarray(ceiling, np.int32).copy(),
        size=states.size,
        rise=spacing,
        footprint=footprint,
    )


@lean_kernel
def update_terrain(terrain, mean, precision, levels):
    """Bring a TerrainMap up to date with a belief; arguments and result as of `update_states`."""
    columns, before = terrain.columns, NONE
    changed = update_states(terrain.states, mean, precision, levels)
    for voxel in terrain.states.changed[:changed]:
        column = voxel // terrain.size[2]
        if column != before:
            if _find_ground(terrain, column):
                note_opened(terrain.states, voxel)
            mark_around(columns, column, columns.reach + 2)
            before = column
    update_columns(terrain)
    return changed


@lean_kernel
def update_columns(terrain):
    """Find the edge, the free space and the candidates of the blocks that have to be updated."""
    columns = terrain.columns
    mark_edges(columns)
    for block in range(len(columns.dirty)):
        if columns.dirty[block]:
            _find_room(terrain, block)
            choose_candidate(columns, block)
            take_column(terrain, block)


@lean_kernel
def _find_ground(terrain, column):
    """Find a column's ground from its voxels' states; return whether its state changed."""
    x, y = column // terrain.size[1], column % terrain.size[1]
    high, state = terrain.size[2], terrain.states.state
    ground, now = NONE, UNEXPLORED | UNMAPPED
    for layer in range(high - 1, -1, -1):
        voxel = column * high + layer
        if state[voxel] & COVERED:
            if layer == high - 1 or state[voxel + 1] & (UNMAPPED | COVERED) == 0:
                ground, now = layer + 1, state[voxel] & UNEXPLORED
            break
    different = ground != terrain.ground[x, y] or now != terrain.columns.state[column]
    terrain.ground[x, y], terrain.columns.state[column] = ground, now
    return different


@lean_kernel
def _find_room(terrain, block):
    """Set traversal costs in a block, and ROOM where there is a candidate above a column."""
    low, high = block_span(terrain.columns, block)
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            column = x * terrain.size[1] + y
            for z in range(terrain.size[2]):
                voxel = column * terrain.size[2] + z
                terrain.traversal_cost[voxel] = 1.0 if _may_fly(terrain, x, y, z) else math.inf
            room = False
            for height in range(terrain.voxel.shape[1]):
                room = room or _at_height(terrain, column, height) != NONE
            set_flag(terrain.columns, column, ROOM, room)


@lean_kernel
def _may_fly(terrain, x, y, z):
    """Whether a body's footprint is above mapped ground, below the ceiling and not covered."""
    size = terrain.size
    for offset in terrain.footprint:
        i, j, k = x + offset[0], y + offset[1], z + offset[2]
        if not (0 <= i < size[0] and 0 <= j < size[1] and 0 <= k < size[2]):
            return False
        ground = terrain.ground[i, j]
        if ground == NONE or k < ground or k >= terrain.ceiling[i, j]:
            return False
        if terrain.states.state[flat_index(size, i, j, k)] & COVERED:
            return False
    return True


@inlined_kernel
def _at_height(terrain, column, height):
    """Return the voxel at a height above a column; NONE where a body cannot be, or has scanned."""
    ground = terrain.ground[column // terrain.size[1], column % terrain.size[1]]
    layer = ground + 1 + height * terrain.rise
    if ground == NONE or layer >= terrain.size[2]:
        return NONE
    voxel = column * terrain.size[2] + layer
    return NONE if math.isinf(terrain.traversal_cost[voxel]) or terrain.excluded[voxel] else voxel


@lean_kernel
def take_column(terrain, block):
    """Set the candidates of a block: those above the column that represents it."""
    column = terrain.columns.candidate[block]
    for height in range(terrain.voxel.shape[1]):
        terrain.voxel[block, height] = _at_height(terrain, column, height) if column != NONE else NONE


@lean_kernel
def fill_column_costs(terrain, cost, least):
    """Fill (X·Y,) with the least of (V,) float64 path costs to the candidates that a column may have."""
    for column in range(len(least)):
        least[column] = math.inf
        if terrain.columns.flags[column] & CANDIDATE:
            for height in range(terrain.voxel.shape[1]):
                voxel = _at_height(terrain, column, height)
                if voxel != NONE:
                    least[column] = min(least[column], cost[voxel])
