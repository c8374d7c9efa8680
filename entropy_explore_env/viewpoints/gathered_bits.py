"""Bits that the precision of imagined rays should bring: Σ ½ log2(1 + added/p) (Rocha04, eq. 27)."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel

_FOLD_ABOVE = 1e250
"""A product of ratios is folded into bits, by its logarithm, before it could leave a float64."""


@inlined_kernel
def gathered_bits(belief, scratch, count):
    """Σ ½ log2(1 + added/p) over the touched voxels that are not left to teammates; clears what was added."""
    bits, growth = 0.0, 1.0
    for i in range(count):
        voxel = np.uint32(scratch.touched[np.uint32(i)])
        share = np.float64(scratch.added[voxel]) / np.float64(belief.precision[voxel])
        scratch.added[voxel] = 0.0
        growth *= 1.0 + (0.0 if scratch.left[voxel] else share)
        if growth > _FOLD_ABOVE:
            bits += math.log2(growth)
            growth = 1.0
    return 0.5 * (bits + math.log2(growth))
