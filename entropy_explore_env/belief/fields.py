"""Fields that can be read off a belief: the gradient of voxel entropy (Rocha04, eq. 30)."""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import inlined_kernel


@inlined_kernel
def entropy_gradient(precision, i, j, k, voxel_size_m):
    """Backward difference of the voxel entropy (Rocha04, eq. 30).

        ∇h(l) ≈ 1/vsz · [h(l) - h(l_x-), h(l) - h(l_y-), h(l) - h(l_z-)]

    Along an axis on which voxel l is the first there is no voxel before it: that component is 0.

    Args:
        precision: (X, Y, Z) float32, 1/σ².
        i: Index of voxel l along x.
        j: Along y.
        k: Along z.
        voxel_size_m: Edge of a voxel.

    Returns:
        Three components in bits per metre.
    """
    here = math.log2(precision[i, j, k])
    scale = 0.5 / voxel_size_m
    along_x = scale * (math.log2(precision[i - 1, j, k]) - here) if i > 0 else 0.0
    along_y = scale * (math.log2(precision[i, j - 1, k]) - here) if j > 0 else 0.0
    along_z = scale * (math.log2(precision[i, j, k - 1]) - here) if k > 0 else 0.0
    return along_x, along_y, along_z
