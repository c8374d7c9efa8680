"""The frontier of a map of voxels, kept up to date as the belief changes.

A body may stand where its whole footprint is mapped and believed free; the path search finds the connected
part. Grid units; voxels by number, C order. `blocks` is the Blocks of the robot's voxels, `cost` the (V,)
float32 traversal costs: 1 where the body may stand, else inf.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.raycast import OPEN, Line, cast_range
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.frontiers.blocks import (
    CANDIDATE,
    COUNTED_FREE,
    DROPPED,
    EDGE,
    EXCLUDED,
    NONE,
    ROOM,
    block_span,
    cell_at,
    choose_candidate,
    count_for_bodies,
    mark_changed,
    mark_edges,
    set_flag,
    shares_face,
)
from entropy_explore_env.frontiers.voxel_states import COVERED, UNEXPLORED, UNMAPPED, update_states

_KNOWN_FREE = 1
"""States above this are unmapped or covered."""
AT_ONCE = 1 << 16
"""Voxels whose states are updated at once."""
_SHORT = 1e-6
"""Voxel edges by which a line ends before the face of the voxel that is looked at."""


def body_footprint(shape: tuple[int, int, int], body_radius: float, layer: int | None) -> np.ndarray:
    """Return (F, 3) int64 index offsets of the voxels that a body touches; its own first."""
    body = [tuple(offset) for offset in new_lattice(shape, body_radius, layer).footprint.tolist()]
    return np.array([(0, 0, 0), *(offset for offset in body if any(offset))], np.int64)


@lean_kernel
def update_voxels(states, blocks, cost, mean, precision, levels):
    """Bring states, blocks and costs up to date with a belief; return how many voxels changed."""
    changed = 0
    for begin in range(0, len(mean), AT_ONCE):
        count = update_states(states, mean, precision, levels, begin, min(begin + AT_ONCE, len(mean)))
        changed += count
        for voxel in states.changed[:count]:
            z = grid_index(blocks.size, voxel)[2]
            if blocks.layer < 0 or abs(z - blocks.layer) <= blocks.reach + 2:
                mark_changed(blocks, voxel)
            if len(blocks.free) > 0:
                free = blocks.state[voxel] & (UNMAPPED | COVERED) == 0
                count_for_bodies(blocks, blocks.free, voxel, COUNTED_FREE, free)
    update_blocks(blocks, cost)
    return changed


@lean_kernel
def update_blocks(blocks, cost):
    """Find the edge, the places to stand and the candidates of the blocks that have to be updated."""
    mark_edges(blocks)
    for block in range(len(blocks.dirty)):
        if blocks.dirty[block]:
            _find_room(blocks, cost, block)
            choose_candidate(blocks, block)


@lean_kernel
def _find_room(blocks, cost, block):
    """Set traversal costs and ROOM in a block."""
    low, high = block_span(blocks, block)
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            for z in range(low[2], high[2]):
                voxel, stands = flat_index(blocks.size, x, y, z), _may_stand(blocks, x, y, z)
                cost[voxel] = 1.0 if stands else math.inf
                set_flag(blocks, voxel, ROOM, stands and blocks.flags[voxel] & EXCLUDED == 0)


@lean_kernel
def _may_stand(blocks, x, y, z):
    """Return whether the body's footprint is mapped, believed free and inside the workspace."""
    if len(blocks.free) > 0:
        return blocks.free[flat_index(blocks.size, x, y, z)] == len(blocks.footprint)
    for offset in blocks.footprint:
        up = z + offset[2]
        if blocks.layer >= 0 and not 0 <= up < blocks.size[2]:
            continue  # the boundary above and below does not limit bodies that stay in a layer
        near = cell_at(blocks.size, x + offset[0], y + offset[1], up)
        if near == NONE or blocks.state[near] & (UNMAPPED | COVERED):
            return False
    return True


@lean_kernel
def collect_candidates(blocks, cells, of_block):
    """Fill (V,) int32 with the frontier cells, block by block, and with their blocks; return how many."""
    count = 0
    for block in range(len(blocks.candidate)):
        if blocks.candidate[block] == NONE:
            continue
        low, high = block_span(blocks, block)
        for x in range(low[0], high[0]):
            for y in range(low[1], high[1]):
                for z in range(low[2], high[2]):
                    cell = flat_index(blocks.size, x, y, z)
                    if blocks.flags[cell] & CANDIDATE:
                        cells[count], of_block[count] = cell, block
                        count += 1
    return count


@lean_kernel
def count_connected(blocks, found, count, most):
    """Return how many EDGE voxels are connected with some, by sides, edges or corners; at most `most`.

    The search begins with the first `count` of (≥ most + count,) int64 `found`; the rest is scratch space.
    """
    size, place = blocks.size, 0
    while place < count and count < most:
        x, y, z = grid_index(size, found[place])
        place += 1
        for i in range(max(x - 1, 0), min(x + 2, size[0])):
            for j in range(max(y - 1, 0), min(y + 2, size[1])):
                for k in range(max(z - 1, 0), min(z + 2, size[2])):
                    near = flat_index(size, i, j, k)
                    known = count >= most or blocks.flags[near] & EDGE == 0
                    for other in range(count):
                        known = known or found[other] == near
                    if not known:
                        found[count] = near
                        count += 1
    return min(count, most)


@lean_kernel
def keep_unseen(blocks, voxels):
    """Move those of (K,) int32 voxels to the front that are unexplored and beside an edge, or one.

    Dropped edges do not count. The number of such voxels is returned.
    """
    count = 0
    for voxel in voxels:
        x, y, z = grid_index(blocks.size, voxel)
        edge = blocks.flags[voxel] & (EDGE | DROPPED) == EDGE
        if blocks.state[voxel] & UNEXPLORED and (
            edge or shares_face(blocks, blocks.flags, EDGE | DROPPED, EDGE, x, y, z)
        ):
            voxels[count] = voxel
            count += 1
    return count


@lean_kernel
def first_viewing_place(blocks, places, voxels, reach):
    """Return the index of the first of (K,) int32 voxels that shows all of (N,) others; NONE = none.

    A voxel is visible up to `reach` voxel edges off; where there is none to see, no place will do.
    """
    for number in range(len(places)):
        all_visible = len(voxels) > 0
        for voxel in voxels:
            all_visible = all_visible and is_visible(blocks, places[number], voxel, reach)
        if all_visible:
            return number
    return NONE


@lean_kernel
def is_visible(blocks, place, voxel, reach):
    """Return whether known free space leads from a voxel's centre straight to a face of another in reach."""
    a, b = grid_index(blocks.size, place), grid_index(blocks.size, voxel)
    x, y, z = float(b[0] - a[0]), float(b[1] - a[1]), float(b[2] - a[2])
    length = math.sqrt(x * x + y * y + z * z)
    if length > reach:
        return False
    until = length - 0.5 * length / max(abs(x), abs(y), abs(z), 1.0) - _SHORT  # where it enters the voxel
    if until <= 0.0:
        return True
    start, direction = (a[0] + 0.5, a[1] + 0.5, a[2] + 0.5), (x / length, y / length, z / length)
    _, _, end = cast_range(blocks.state, blocks.size, Line(start, direction, until), _KNOWN_FREE)
    return end == OPEN


def voxels_around(size: tuple[int, int, int], voxel: int, radius: int, layer: int) -> np.ndarray:
    """Return (N,) int32 voxels within a radius along every axis, in one layer or, with -1, in all."""
    ranges = [
        np.arange(max(int(at) - radius, 0), min(int(at) + radius + 1, n))
        for at, n in zip(np.unravel_index(voxel, size), size, strict=True)
    ]
    if layer >= 0:
        ranges[2] = np.array([layer])
    return np.ravel_multi_index(np.ix_(*ranges), size).astype(np.int32).reshape(-1)
