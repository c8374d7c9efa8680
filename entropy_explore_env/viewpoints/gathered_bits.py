"""The precision that imagined rays add to voxels, and the bits: Σ ½ log2(1 + added/p) (Rocha04, eq. 27)."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel

LEAST_GAIN = 1e-45
"""Precision that float32 still holds: what is added to a voxel is more than 0."""
_FOLD_ABOVE = 1e250
"""A product of ratios is folded into bits, by its logarithm, before it could leave a float64."""


@inlined_kernel
def touch(scratch, voxel, gain, count):
    """Add precision to a voxel, and note it among the touched ones if it is the first that is added to it.

    It is always written down, and kept where it is the first: a branch that nothing predicts costs more.

    Args:
        scratch: A ScanScratch.
        voxel: Its number.
        gain: Precision, at least LEAST_GAIN: what adds nothing would be touched anew by every ray.
        count: How many voxels are touched.

    Returns:
        How many are now.
    """
    before = scratch.added[voxel]
    scratch.touched[np.uint32(count)] = voxel
    scratch.added[voxel] = before + gain
    return count + int(before == 0.0)


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
