"""How uncertain voxels are, and where a body fits: the fields of Voronoi coverage, in nats.

Bhattacharya 2010 uses the entropy of occupancy (belief/entropy.py); an entropy by standard deviation is ours.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from entropy_explore_env.belief.entropy import LN2
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.compilation.kernels import lean_kernel


@lean_kernel
def fill_deviation_entropy(
    precision: np.ndarray, prior_precision: float, end_precision: float, entropy: np.ndarray
) -> None:
    """Fill (V,) float32: ln 2 at the prior, 0 from the end's precision on, linear in log σ between them.

    Rocha04's missions ask for this: a voxel is known when its standard deviation is σ_end.
    """
    scale = LN2 / math.log(end_precision / prior_precision)
    for voxel in range(len(precision)):
        missing = math.log(end_precision / np.float64(precision[voxel])) * scale
        entropy[voxel] = min(max(missing, 0.0), LN2)


def filtered(entropy: np.ndarray) -> np.ndarray:
    """The least entropy of each voxel and those around it (sect. 5.3): 3 × 3, or 3 × 3 × 3."""
    return ndimage.minimum_filter(entropy, size=[3 if n > 1 else 1 for n in entropy.shape], mode="nearest")


@lean_kernel
def inflate_obstacles(
    mean: np.ndarray,
    footprint: np.ndarray,
    margin: tuple[int, int, int],
    layer: int,
    start: tuple[int, int, int],
    traversal_cost: np.ndarray,
) -> None:
    """Make the voxels impassable in which a body does not fit, except for its way out from where it starts.

    Args:
        mean: (X, Y, Z) float32, expected coverage; above ½ a voxel is an obstacle.
        footprint: (B, 3) int64 index offsets of the voxels that the body touches; empty = its own only.
        margin: Layers at either end of each axis in which the body would touch the boundary.
        layer: The only one that can be entered; -1 = all.
        start: Indices of the robot's voxel.
        traversal_cost: (X, Y, Z) float32, set to inf there.
    """
    size_x, size_y, size_z = mean.shape
    for x in range(size_x):
        for y in range(size_y):
            for z in range(size_z):
                outside = x < margin[0] or y < margin[1] or z < margin[2]
                outside = outside or x >= size_x - margin[0] or y >= size_y - margin[1]
                if outside or z >= size_z - margin[2] or (layer >= 0 and z != layer):
                    traversal_cost[x, y, z] = math.inf
                if mean[x, y, z] > STOP_AT_COVERED:
                    traversal_cost[x, y, z] = math.inf
                    for offset in footprint:
                        i, j, k = x - offset[0], y - offset[1], z - offset[2]
                        if 0 <= i < size_x and 0 <= j < size_y and 0 <= k < size_z:
                            traversal_cost[i, j, k] = math.inf
    if math.isinf(traversal_cost[start[0], start[1], start[2]]):
        for offset in footprint:
            i, j, k = start[0] + offset[0], start[1] + offset[1], start[2] + offset[2]
            if 0 <= i < size_x and 0 <= j < size_y and 0 <= k < size_z and (layer < 0 or k == layer):
                if mean[i, j, k] <= STOP_AT_COVERED:
                    traversal_cost[i, j, k] = LN2
        traversal_cost[start[0], start[1], start[2]] = LN2
