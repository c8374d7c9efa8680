"""The part `patch`: the belief around the robot."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.pooling import normalised_entropy
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.poses import grid_size

PATCH_CHANNELS = 4


@lean_kernel
def observe_patch(begin, params, shape, robot, start, known, row):
    """Fill (4·x·y·z,): the belief around the robot's voxel; outside the workspace it is covered.

    Args:
        shape: (x, y, z) voxels of the patch.
    """
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out = row[begin:]
    size = grid_size(params)
    prior, end = params.prior_precision, params.end_precision
    cells = shape[0] * shape[1] * shape[2]
    corner_x = math.floor(start[0]) - shape[0] // 2
    corner_y = math.floor(start[1]) - shape[1] // 2
    corner_z = math.floor(start[2]) - shape[2] // 2
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                cell = flat_index(shape, i, j, k)
                x, y, z = corner_x + i, corner_y + j, corner_z + k
                inside = 0 <= x < size[0] and 0 <= y < size[1] and 0 <= z < size[2]
                voxel = flat_index(size, x, y, z) if inside else 0
                out[cell] = known.mean[voxel] if inside else 1.0
                out[cells + cell] = (
                    normalised_entropy(prior, end, np.float64(known.precision[voxel])) if inside else 0.0
                )
                out[2 * cells + cell] = 0.0 if inside else 1.0
                out[3 * cells + cell] = 0.0
    for mate in range(len(known.heard)):
        if mate != robot and known.heard[mate].heard_s >= 0.0:
            there, low = known.heard[mate].pose, params.origin_m
            x = math.floor((there[0] - low[0]) / params.voxel_size_m) - corner_x
            y = math.floor((there[1] - low[1]) / params.voxel_size_m) - corner_y
            z = math.floor((there[2] - low[2]) / params.voxel_size_m) - corner_z
            if 0 <= x < shape[0] and 0 <= y < shape[1] and 0 <= z < shape[2]:
                out[3 * cells + flat_index(shape, x, y, z)] = 1.0
