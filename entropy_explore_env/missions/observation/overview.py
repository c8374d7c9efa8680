"""The part `overview`: the whole belief, averaged over the cells of a coarse grid."""

from __future__ import annotations

from entropy_explore_env.compilation.kernels import lean_kernel

OVERVIEW_CHANNELS = 2


@lean_kernel
def observe_overview(begin, cells, sums, row):
    """Fill (2·C,): normalised entropy and expected coverage, means over Cells, from (2, C) sums."""
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out = row[begin:]
    count = len(cells.voxels)
    for cell in range(count):
        out[cell] = min(max(sums[0, cell] / cells.voxels[cell], 0.0), 1.0)
        out[count + cell] = min(max(sums[1, cell] / cells.voxels[cell], 0.0), 1.0)
