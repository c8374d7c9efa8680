"""The frontier of a map of voxels, kept up to date as the belief changes.

A body may stand where its whole footprint is mapped and believed free; the path search finds the connected
part. Grid units; voxels by number, C order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.frontiers.blocks import (
    CANDIDATE,
    COVERED,
    DROPPED,
    EDGE,
    EXCLUDED,
    NONE,
    UNEXPLORED,
    UNMAPPED,
    Blocks,
    block_span,
    cell_at,
    choose_candidate,
    mark_edges,
    new_blocks,
    queue_around,
    set_room,
    shares_face,
)
from entropy_explore_env.frontiers.voxel_states import VoxelStates, new_states, update_states


class VoxelMap(NamedTuple):
    """What is read off one robot's belief; V voxels in B blocks."""

    states: VoxelStates
    blocks: Blocks
    traversal_cost: np.ndarray
    """(V,) float32, 1 where the body may stand, else inf."""
    bounds: np.ndarray
    """(B,) float64, upper bound of the points that can be seen from a block's candidate; inf = unknown."""


def new_voxel_map(
    shape: tuple[int, int, int], body_radius: float, layer: int | None, spacing: int
) -> VoxelMap:
    """Return a map of which nothing is explored.

    Args:
        shape: (X, Y, Z) voxels.
        body_radius: In voxel edges.
        layer: The only one with candidates (planar robots); None = all.
        spacing: Voxels along the edge of a block.
    """
    states = new_states(shape)
    blocks = new_blocks(shape, states.state, body_footprint(shape, body_radius, layer), layer, spacing)
    bounds = np.full(len(blocks.candidate), np.inf)
    return VoxelMap(states, blocks, np.full(len(states.state), np.inf, np.float32), bounds)


def body_footprint(shape: tuple[int, int, int], body_radius: float, layer: int | None) -> np.ndarray:
    """Return (F, 3) int64 index offsets of the voxels that a body touches; its own first."""
    body = [tuple(offset) for offset in new_lattice(shape, body_radius, layer).footprint.tolist()]
    return np.array([(0, 0, 0), *(offset for offset in body if any(offset))], np.int64)


@lean_kernel
def update_voxels(voxels, mean, precision, levels):
    """Bring a VoxelMap up to date with a belief; arguments and result as of `update_states`."""
    blocks, count = voxels.blocks, 0
    changed = update_states(voxels.states, mean, precision, levels)
    for place in range(changed):
        voxel = voxels.states.changed[place]
        z = grid_index(blocks.size, voxel)[2]
        if blocks.layer < 0 or abs(z - blocks.layer) <= blocks.reach + 2:
            count = queue_around(blocks, voxel, blocks.reach + 2, count)
    update_blocks(voxels, count)
    return changed


@lean_kernel
def update_blocks(voxels, count):
    """Find the edge, the places to stand and the candidates of the first `count` queued blocks."""
    blocks = voxels.blocks
    mark_edges(blocks, count)
    for place in range(count):
        block = blocks.queued[place]
        _find_room(voxels, block)
        if choose_candidate(blocks, block):
            voxels.bounds[block] = math.inf


@lean_kernel
def _find_room(voxels, block):
    """Set traversal costs and ROOM in a block."""
    blocks = voxels.blocks
    low, high = block_span(blocks, block)
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            for z in range(low[2], high[2]):
                voxel, stands = flat_index(blocks.size, x, y, z), _may_stand(blocks, x, y, z)
                voxels.traversal_cost[voxel] = 1.0 if stands else math.inf
                set_room(blocks, voxel, stands and blocks.flags[voxel] & EXCLUDED == 0)


@lean_kernel
def _may_stand(blocks, x, y, z):
    """Whether the body's footprint is mapped, believed free and inside the workspace."""
    for offset in blocks.footprint:
        up = z + offset[2]
        if blocks.layer >= 0 and not 0 <= up < blocks.size[2]:
            continue  # the boundary above and below does not limit bodies that stay in a layer
        near = cell_at(blocks.size, x + offset[0], y + offset[1], up)
        if near == NONE or blocks.state[near] & (UNMAPPED | COVERED):
            return False
    return True


@lean_kernel
def collect_candidates(blocks, listed, found, of_block):
    """Fill in all candidates of (K,) int64 blocks one after the other; return how many there are.

    Args:
        blocks: Of the robot.
        listed: The blocks.
        found: (N,) int32 voxels.
        of_block: (N,) int64, each one's block, as an index in `listed`.
    """
    count = 0
    for place in range(len(listed)):
        low, high = block_span(blocks, listed[place])
        for x in range(low[0], high[0]):
            for y in range(low[1], high[1]):
                for z in range(low[2], high[2]):
                    voxel = flat_index(blocks.size, x, y, z)
                    if blocks.flags[voxel] & CANDIDATE:
                        found[count], of_block[count] = voxel, place
                        count += 1
    return count


@lean_kernel
def fill_nearest(lengths, of_block, reach, nearest):
    """Set (K,) indices of the first of the nearest cells of K blocks, by (N,) lengths up to `reach`."""
    for cell in range(len(lengths)):
        best = nearest[of_block[cell]]
        near = lengths[cell] <= reach and not math.isinf(lengths[cell])
        if near and (best == NONE or lengths[cell] < lengths[best]):
            nearest[of_block[cell]] = cell


@lean_kernel
def count_connected(blocks, found, count, most):
    """Return how many EDGE voxels are connected with some, by sides, edges or corners; at most `most`.

    Args:
        blocks: Of the robot.
        found: (≥ most + count,) int64, the first `count` are filled in; the others are scratch space.
        count: How many the search begins with.
        most: Where counting ends.
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

    Returns:
        How many there are. Dropped edges do not count.
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


def box_around(size: tuple[int, int, int], voxel: int, radius: int, layer: int) -> tuple[slice, ...]:
    """Return slices of the voxels within a radius along every axis, in one layer or, with -1, in all."""
    box = [
        slice(max(int(at) - radius, 0), min(int(at) + radius + 1, n))
        for at, n in zip(np.unravel_index(voxel, size), size, strict=True)
    ]
    return (*box[:2], box[2] if layer < 0 else slice(layer, layer + 1))


def voxels_in(box: tuple[slice, ...], size: tuple[int, int, int]) -> np.ndarray:
    """Return (N,) int32 voxels of a box in C order."""
    return np.asarray(np.ravel_multi_index(np.ogrid[box], size), np.int32).reshape(-1)
