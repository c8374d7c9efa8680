"""Frontier candidates of a belief, kept up to date as it changes: where mapped space ends (Yamauchi 1998).

A voxel is explored once its σ has fallen to a stated level. A body may stand where its whole footprint is
explored at the first such level and believed free; this is the mapped region, and the path search finds its
connected part. Its edge consists of free voxels next to unexplored ones; at a finer level, also of voxels
that are unexplored themselves. A candidate is a voxel in which the body may stand and whose footprint meets
the edge. Each block of voxels, as wide as the sampling's spacing, is represented by the candidate nearest to
its middle. Grid units; voxels by number, C order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

UNEXPLORED = 1
"""σ is above the level that counts as explored now."""
UNMAPPED = 2
"""σ is above the first such level: no place to drive through."""
COVERED = 4
"""Believed covered: it stops rays and bodies."""
STOPS_RAYS = 3
"""States above this do."""

EDGE = 1
"""Mapped and free, and itself unexplored at the level that counts now, or beside such a voxel."""
CANDIDATE = 2
EXCLUDED = 4
"""A scan was taken here: no candidate any more."""
DROPPED = 8
"""An edge that a scan from beside it did not explore: nothing beside it alone is a candidate."""

MAX_TRACKED_OPENINGS = 256
"""At most this many newly freed voxels are tracked between updates; beyond that, recounting is as fast."""
NONE = -1
BLOCK_VOXELS = 128
"""Voxels that are checked together for new measurements."""


class FrontierMap(NamedTuple):
    """What is read off one robot's belief; V voxels in B blocks."""

    state: np.ndarray
    """(V,) uint8, flags: UNEXPLORED, UNMAPPED, COVERED."""
    flags: np.ndarray
    """(V,) uint8: EDGE, CANDIDATE, EXCLUDED, DROPPED."""
    traversal_cost: np.ndarray
    """(V,) float32, 1 where the body may stand, else inf."""
    voxel: np.ndarray
    """(B,) int32, the candidate of a block; NONE = it has none."""
    seen: np.ndarray
    """(B,) float32, upper bound of the points that can be seen from the candidate; inf = unknown."""
    dirty: np.ndarray
    """(B,) uint8, whether a block has to be updated."""
    queued: np.ndarray
    """(B,) int32, the blocks that have to be updated."""
    sums: np.ndarray
    """(V / BLOCK_VOXELS,) uint64, sums of the bit patterns of precisions at the latest update."""
    levels: np.ndarray
    """(2,) float32, levels at the latest update; NaN = there was none."""
    opened: np.ndarray
    """(MAX_TRACKED_OPENINGS,) int32, newly freed voxels, past which more may be visible than before."""
    opened_count: np.ndarray
    """(1,) int64, number of them; above MAX_TRACKED_OPENINGS more may be visible from anywhere."""
    size: tuple[int, int, int]
    across: tuple[int, int, int]
    """Voxels of a block along each axis."""
    blocks: tuple[int, int, int]
    footprint: np.ndarray
    """(N, 3) int64 index offsets of the voxels that the body touches; its own first."""
    layer: int
    """The only layer of planar robots; -1 = all."""


def new_frontier_map(
    shape: tuple[int, int, int], body_radius: float, layer: int | None, spacing: int
) -> FrontierMap:
    """A map of which nothing is explored.

    Args:
        shape: (X, Y, Z) voxels.
        body_radius: In voxel edges.
        layer: The only one with candidates (planar robots); None = all.
        spacing: Voxels along the edge of a block.
    """
    body = [tuple(offset) for offset in new_lattice(shape, body_radius, layer).footprint.tolist()]
    footprint = [(0, 0, 0), *(offset for offset in body if any(offset))]
    flat = shape[2] == 1 or layer is not None
    across = (spacing, spacing, shape[2] if flat else spacing)
    blocks = tuple(math.ceil(n / width) for n, width in zip(shape, across, strict=True))
    voxels, count = math.prod(shape), math.prod(blocks)
    return FrontierMap(
        state=np.full(voxels, UNEXPLORED | UNMAPPED, np.uint8),
        flags=np.zeros(voxels, np.uint8),
        traversal_cost=np.full(voxels, np.inf, np.float32),
        voxel=np.full(count, NONE, np.int32),
        seen=np.full(count, np.inf, np.float32),
        dirty=np.zeros(count, np.uint8),
        queued=np.zeros(count, np.int32),
        sums=np.zeros(math.ceil(voxels / BLOCK_VOXELS), np.uint64),
        levels=np.full(2, np.nan, np.float32),
        opened=np.zeros(MAX_TRACKED_OPENINGS, np.int32),
        opened_count=np.zeros(1, np.int64),
        size=(int(shape[0]), int(shape[1]), int(shape[2])),
        across=across,
        blocks=(blocks[0], blocks[1], blocks[2]),
        footprint=np.array(footprint, np.int64),
        layer=-1 if layer is None else int(layer),
    )


@inlined_kernel
def state_of(mean, precision, levels):
    """Flags of a voxel from its belief; `levels` as in `update_frontiers`."""
    unexplored, unmapped = np.uint8(precision < levels[0]), np.uint8(precision < levels[1])
    covered = (
        np.uint8(mean > np.float32(STOP_AT_COVERED)) & ~unmapped
    )  # without branches: many voxels at once
    return np.uint8(unexplored * UNEXPLORED | unmapped * UNMAPPED | covered * COVERED)


@lean_kernel
def queue_block(frontiers, block, count):
    """Queue a block for its update; returns the number of queued blocks."""
    if frontiers.dirty[block] == 0:
        frontiers.dirty[block] = 1
        frontiers.queued[count] = block
        count += 1
    return count


@lean_kernel
def _queue_around(frontiers, x, y, z, reach, count):
    """Queue the blocks that have a voxel within `reach` along every axis."""
    size, across, blocks = frontiers.size, frontiers.across, frontiers.blocks
    for i in range(max(x - reach, 0) // across[0], min(x + reach, size[0] - 1) // across[0] + 1):
        for j in range(max(y - reach, 0) // across[1], min(y + reach, size[1] - 1) // across[1] + 1):
            for k in range(max(z - reach, 0) // across[2], min(z + reach, size[2] - 1) // across[2] + 1):
                count = queue_block(frontiers, flat_index(blocks, i, j, k), count)
    return count


@inlined_kernel
def _note_opened(frontiers, voxel):
    """Note that a voxel turned free."""
    count = frontiers.opened_count[0]
    if count < MAX_TRACKED_OPENINGS:
        frontiers.opened[count] = voxel
    if count <= MAX_TRACKED_OPENINGS:
        frontiers.opened_count[0] = count + 1


@lean_kernel
def update_frontiers(frontiers, mean, precision, levels):
    """Bring the map up to date with a belief: sums over all voxels, and work where something changed.

    A measurement raises a voxel's precision, and with it the integer that its bit pattern represents. So the
    sum over some voxels is unchanged only if none of them was measured. (A measurement too weak to raise a
    float32 does not change the mean either.)

    Args:
        frontiers: Of the robot.
        mean: (V,) float32, changed since the latest update only where the precision was raised.
        precision: (V,) float32 1/σ², nowhere less than at the latest update.
        levels: (explored, mapped): precisions from which on a voxel is explored, and mapped.

    Returns:
        How many voxels are in another state than at the latest update.
    """
    size, layer, state = frontiers.size, frontiers.layer, frontiers.state
    reach, count, changed, bits = 2, 0, 0, precision.view(np.uint32)
    as_before = frontiers.levels[0] == levels[0] and frontiers.levels[1] == levels[1]
    frontiers.levels[0], frontiers.levels[1] = levels[0], levels[1]
    for offset in frontiers.footprint:
        reach = max(reach, abs(offset[0]) + 2)
    for first in range(0, len(state), BLOCK_VOXELS):
        last, total = min(first + BLOCK_VOXELS, len(state)), np.uint64(0)
        for voxel in range(first, last):
            total += np.uint64(bits[voxel])
        if as_before and total == frontiers.sums[first // BLOCK_VOXELS]:
            continue
        frontiers.sums[first // BLOCK_VOXELS] = total
        for voxel in range(first, last):
            now = state_of(mean[voxel], precision[voxel], levels)
            before = state[voxel]
            if now == before:
                continue
            state[voxel] = now
            changed += 1
            column = voxel // size[2]
            x, y, z = column // size[1], column % size[1], voxel % size[2]
            if before & COVERED > now & COVERED:
                _note_opened(frontiers, voxel)
            if before & UNEXPLORED < now & UNEXPLORED:  # a finer level counts now
                frontiers.opened_count[0] = MAX_TRACKED_OPENINGS + 1
            if layer < 0 or abs(z - layer) <= reach:
                count = _queue_around(frontiers, x, y, z, reach, count)
    update_blocks(frontiers, count)
    return changed


@lean_kernel
def update_blocks(frontiers, count):
    """Find the edge, the places to stand and the candidates of the queued blocks."""
    for place in range(count):
        _mark_edge(frontiers, frontiers.queued[place])
    for place in range(count):
        block = frontiers.queued[place]
        _choose_candidate(frontiers, block)
        frontiers.dirty[block] = 0


@inlined_kernel
def block_span(frontiers, block):
    """First voxel of a block along each axis, and one past its last."""
    size, across, blocks = frontiers.size, frontiers.across, frontiers.blocks
    k = block % blocks[2]
    j = block // blocks[2] % blocks[1]
    i = block // (blocks[2] * blocks[1])
    low, high = k * across[2], min((k + 1) * across[2], size[2])
    if frontiers.layer >= 0:
        low, high = frontiers.layer, frontiers.layer + 1
    return (
        (i * across[0], j * across[1], low),
        (min((i + 1) * across[0], size[0]), min((j + 1) * across[1], size[1]), high),
    )


@inlined_kernel
def _at(size, x, y, z):
    """Number of a voxel; NONE = outside."""
    if 0 <= x < size[0] and 0 <= y < size[1] and 0 <= z < size[2]:
        return flat_index(size, x, y, z)
    return NONE


@inlined_kernel
def shares_face(frontiers, marks, mask, value, x, y, z):
    """Whether a voxel shares a face with one of certain marks; of planar robots in their layer.

    Args:
        frontiers: Of the robot.
        marks: (V,) uint8, `state` or `flags`.
        mask: Marks that are looked at.
        value: What they have to be.
        x: Of the voxel, likewise y and z.
        y: Likewise.
        z: Likewise.
    """
    size, found = frontiers.size, False
    for axis in range(2 if frontiers.layer >= 0 else 3):
        for step in (-1, 1):
            near = _at(
                size,
                x + (step if axis == 0 else 0),
                y + (step if axis == 1 else 0),
                z + (step if axis == 2 else 0),
            )
            if near != NONE and marks[near] & mask == value:
                found = True
    return found


@lean_kernel
def _mark_edge(frontiers, block):
    """Set EDGE in a block."""
    low, high = block_span(frontiers, block)
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            for z in range(low[2], high[2]):
                voxel = _at(frontiers.size, x, y, z)
                frontiers.flags[voxel] &= CANDIDATE | EXCLUDED | DROPPED
                free = frontiers.state[voxel] & (UNMAPPED | COVERED) == 0
                if free and (
                    frontiers.state[voxel] & UNEXPLORED
                    or shares_face(frontiers, frontiers.state, UNEXPLORED, UNEXPLORED, x, y, z)
                ):
                    frontiers.flags[voxel] |= EDGE


@lean_kernel
def may_stand(frontiers, x, y, z):
    """Whether the body's footprint is mapped, believed free and inside the workspace."""
    for offset in frontiers.footprint:
        up = z + offset[2]
        if frontiers.layer >= 0 and not 0 <= up < frontiers.size[2]:
            continue  # the boundary above and below does not limit bodies that stay in a layer
        near = _at(frontiers.size, x + offset[0], y + offset[1], up)
        if near == NONE or frontiers.state[near] & (UNMAPPED | COVERED):
            return False
    return True


@lean_kernel
def _choose_candidate(frontiers, block):
    """Set traversal costs and CANDIDATE in a block, and choose its candidate."""
    low, high = block_span(frontiers, block)
    best, nearest = NONE, math.inf
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            for z in range(low[2], high[2]):
                voxel = _at(frontiers.size, x, y, z)
                stands = frontiers.state[voxel] & (UNMAPPED | COVERED) == 0 and may_stand(frontiers, x, y, z)
                frontiers.traversal_cost[voxel] = 1.0 if stands else math.inf
                frontiers.flags[voxel] &= EDGE | EXCLUDED | DROPPED
                if not stands or frontiers.flags[voxel] & EXCLUDED:
                    continue
                for offset in frontiers.footprint:
                    near = _at(frontiers.size, x + offset[0], y + offset[1], z + offset[2])
                    if near != NONE and frontiers.flags[near] & (EDGE | DROPPED) == EDGE:
                        frontiers.flags[voxel] |= CANDIDATE
                        break
                if frontiers.flags[voxel] & CANDIDATE:
                    apart = _apart(low, high, x, y, z)
                    if apart < nearest:
                        best, nearest = voxel, apart
    if best != frontiers.voxel[block]:
        frontiers.voxel[block] = best
        frontiers.seen[block] = math.inf


@inlined_kernel
def _apart(low, high, x, y, z):
    """Squared distance, in half voxels, of a voxel from the middle of its block."""
    dx, dy, dz = 2 * x + 1 - low[0] - high[0], 2 * y + 1 - low[1] - high[1], 2 * z + 1 - low[2] - high[2]
    return dx * dx + dy * dy + dz * dz


@lean_kernel
def choose_reached(frontiers, cost, block):
    """Another candidate of a block that a search reached, with a finite path cost; NONE = there is none."""
    low, high = block_span(frontiers, block)
    best, nearest = NONE, math.inf
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            for z in range(low[2], high[2]):
                voxel = _at(frontiers.size, x, y, z)
                if frontiers.flags[voxel] & CANDIDATE and not math.isinf(cost[voxel]):
                    apart = _apart(low, high, x, y, z)
                    if apart < nearest:
                        best, nearest = voxel, apart
    return best
