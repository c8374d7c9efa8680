"""Groups of connected frontier voxels, and which of them are large.

Between the rays of a sensor, fine grids keep slivers of unknown voxels. A rule that goes to the nearest
frontier cell would look into each of them in turn. So groups of few voxels are left out, as in FUEL (Zhou et
al. 2021). Voxels are connected by sides, edges or corners. `blocks` is a Blocks.
"""

from __future__ import annotations

from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.frontiers.blocks import DROPPED, EDGE, block_span, meets

LARGE = 1
_FOUND = 2


@lean_kernel
def fill_groups(blocks, least, found, groups):
    """Mark groups of at least `least` EDGE voxels as LARGE, and return whether there are any.

    DROPPED voxels do not count. (V,) uint8 `groups` is replaced, (V,) int32 `found` is scratch space.
    """
    groups[:] = 0
    any_large = False
    for block in range(len(blocks.edges)):
        if blocks.edges[block] == 0:
            continue
        low, high = block_span(blocks, block)
        for x in range(low[0], high[0]):
            for y in range(low[1], high[1]):
                for z in range(low[2], high[2]):
                    voxel = flat_index(blocks.size, x, y, z)
                    if groups[voxel] == 0 and _is_edge(blocks, voxel):
                        count = _fill_group(blocks, voxel, found, groups)
                        any_large = any_large or count >= least
                        for place in range(count):
                            groups[found[place]] = _FOUND | (LARGE if count >= least else 0)
    return any_large


@lean_kernel
def _is_edge(blocks, voxel):
    """Return whether a voxel is an EDGE that is not DROPPED."""
    return blocks.flags[voxel] & (EDGE | DROPPED) == EDGE


@lean_kernel
def _fill_group(blocks, voxel, found, groups):
    """Fill `found` with the group of a voxel, mark it as found, and return its size."""
    size, count, place = blocks.size, 1, 0
    found[0], groups[voxel] = voxel, _FOUND
    while place < count:
        x, y, z = grid_index(size, found[place])
        place += 1
        for i in range(max(x - 1, 0), min(x + 2, size[0])):
            for j in range(max(y - 1, 0), min(y + 2, size[1])):
                for k in range(max(z - 1, 0), min(z + 2, size[2])):
                    near = flat_index(size, i, j, k)
                    if groups[near] == 0 and _is_edge(blocks, near):
                        found[count], groups[near] = near, _FOUND
                        count += 1
    return count


@lean_kernel
def keep_large(blocks, groups, cells, of_block, count):
    """Keep those of the first `count` cells from which a body touches a large group; return their number.

    They move to the front of (V,) int32 `cells` and `of_block`, which `collect_candidates` filled.
    """
    kept = 0
    for place in range(count):
        x, y, z = grid_index(blocks.size, cells[place])
        if meets(blocks, groups, LARGE, LARGE, x, y, z):
            cells[kept], of_block[kept] = cells[place], of_block[place]
            kept += 1
    return kept
