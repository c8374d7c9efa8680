"""A part of a belief that is replaced by what another source says of it."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel


@lean_kernel
def replace_region(belief, size, low, patch, boxes, gains):
    """Replace what is believed of a box of voxels, and count the bits that this takes from the map.

    Args:
        belief: (mean, precision), each (V,) float32, changed in place.
        low: (3,) int64, the belief's voxel that is the patch's first; parts outside are left out.
        patch: (mean, precision), each (I, J, K) float32.
        boxes: (B, 2, 3) int64, corners of boxes of the belief.
        gains: (B,) float64, to which the bits inside each box are added.

    Returns:
        Bits taken from the whole map.
    """
    mean, precision = belief
    new_mean, new_precision = patch
    total = 0.0
    for i in range(max(-low[0], 0), min(new_mean.shape[0], size[0] - low[0])):
        for j in range(max(-low[1], 0), min(new_mean.shape[1], size[1] - low[1])):
            for k in range(max(-low[2], 0), min(new_mean.shape[2], size[2] - low[2])):
                x, y, z = low[0] + i, low[1] + j, low[2] + k
                voxel = (x * size[1] + y) * size[2] + z
                before, after = precision[voxel], new_precision[i, j, k]
                mean[voxel], precision[voxel] = new_mean[i, j, k], after
                if before == after:
                    continue
                bits = 0.5 * math.log2(np.float64(after) / np.float64(before))
                total += bits
                for number in range(len(boxes)):
                    first, last = boxes[number, 0], boxes[number, 1]
                    inside = first[0] <= x <= last[0] and first[1] <= y <= last[1]
                    if inside and first[2] <= z <= last[2]:
                        gains[number] += bits
    return total
