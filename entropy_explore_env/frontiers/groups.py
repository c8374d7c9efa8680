"""Groups of connected frontier voxels, and which of them are large.

Between the rays of a sensor, fine grids keep slivers of unknown voxels. A rule that goes to the nearest
frontier cell would look into each of them in turn. So groups of few voxels are left out, as in FUEL (Zhou et
al. 2021). Voxels are connected by sides, edges or corners; an EDGE that is DROPPED is in no group. A group is
searched when it is asked for, and no farther than until it is known to be large. `blocks` is a Blocks,
`groups` a Groups.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.frontiers.blocks import DROPPED, EDGE, NONE, block_span, cell_at

_SMALL, _LARGE = 1, 2
"""Kinds of the voxels of groups."""


class Groups(NamedTuple):
    """Which of V voxels are in large groups, as far as that was asked."""

    least: int
    """Voxels of the smallest large group; up to 1 = all groups are large, and nothing is searched."""
    kind_of: np.ndarray
    """(V,) uint8: _SMALL, _LARGE, or 0 = not searched yet; (0,) where nothing is searched."""
    found: np.ndarray
    """(least,) int32, scratch space."""

    def forget(self) -> None:
        """Forget what was found, after a change of the edges."""
        self.kind_of[:] = 0


def new_groups(voxels: int, least: int) -> Groups:
    """Return the groups of a map of which nothing was asked yet."""
    return Groups(least, np.zeros(voxels if least > 1 else 0, np.uint8), np.empty(least, np.int32))


@lean_kernel
def any_large(blocks, groups):
    """Return whether any group is large."""
    for block in range(len(blocks.edges)):
        if blocks.edges[block] == 0:
            continue
        low, high = block_span(blocks, block)
        for x in range(low[0], high[0]):
            for y in range(low[1], high[1]):
                for z in range(low[2], high[2]):
                    voxel = flat_index(blocks.size, x, y, z)
                    if _is_grouped(blocks, voxel) and _is_large(blocks, groups, voxel):
                        return True
    return False


@lean_kernel
def fill_nearest(blocks, groups, cells, lengths, of_block, reach, nearest):
    """Find the nearest cell of each of K blocks from which a body touches a large group.

    The first one counts where several are as near. Where all groups are large, all cells count.

    Args:
        blocks: Blocks of the frontier.
        groups: Groups, in which searched voxels are marked.
        cells: (N,) int32, frontier cells.
        lengths: (N,) of the paths to them; inf = no path.
        of_block: (N,) int32, their blocks.
        reach: Cells with longer paths are left out; inf allowed.
        nearest: (K,) indices in `cells`, changed; NONE = none was found yet.
    """
    for place in range(len(cells)):
        best = nearest[of_block[place]]
        near = lengths[place] <= reach and not math.isinf(lengths[place])
        if near and (best == NONE or lengths[place] < lengths[best]):
            if groups.least <= 1 or _touches_large(blocks, groups, cells[place]):
                nearest[of_block[place]] = place


@lean_kernel
def _touches_large(blocks, groups, cell):
    """Return whether a body in a cell touches a voxel of a large group, and search what groups it takes."""
    x, y, z = grid_index(blocks.size, cell)
    for offset in blocks.footprint:
        near = cell_at(blocks.size, x + offset[0], y + offset[1], z + offset[2])
        if near != NONE and _is_grouped(blocks, near) and _is_large(blocks, groups, near):
            return True
    return False


@inlined_kernel
def _is_grouped(blocks, voxel):
    """Return whether a voxel is in a group."""
    return blocks.flags[voxel] & (EDGE | DROPPED) == EDGE


@inlined_kernel
def _is_large(blocks, groups, voxel):
    """Return whether the group of a voxel is large."""
    if groups.kind_of[voxel] == 0:
        _search_group(blocks, groups, voxel)
    return groups.kind_of[voxel] == _LARGE


@lean_kernel
def _search_group(blocks, groups, voxel):
    """Search the group of a voxel until it is known to be large, and mark the voxels found as what it is."""
    size, found, kind_of = blocks.size, groups.found, groups.kind_of
    found[0], kind_of[voxel] = voxel, _SMALL
    count, place, large = 1, 0, False
    while place < count and not large:
        x, y, z = grid_index(size, found[place])
        place += 1
        for i in range(max(x - 1, 0), min(x + 2, size[0])):
            for j in range(max(y - 1, 0), min(y + 2, size[1])):
                for k in range(max(z - 1, 0), min(z + 2, size[2])):
                    near = flat_index(size, i, j, k)
                    if large or not _is_grouped(blocks, near):
                        continue
                    if kind_of[near] == 0:
                        found[count], kind_of[near] = near, _SMALL
                        count += 1
                    large = count == groups.least or kind_of[near] == _LARGE
    if large:
        for place in range(count):
            kind_of[found[place]] = _LARGE
