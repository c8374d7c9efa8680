"""How good a landmark a voxel of a robot's own map makes (Sujan, eq. 17).

    FEF = f1(P(x)) + f3(H(x)),   f1 ~ P(x) / r,   f3 ~ H(x) · w

P is how certainly the voxel is occupied, r the radius up to which the certainty around it descends, H the
depth contrast and w the window up to which that does not fall. The paper leaves both open ("may be
approximated with some heuristics"); f2, the visual contrast, needs images. Ours:

- Certainty of a voxel is |2 P_occ - 1|, 0 where it was never measured. Shells are the surfaces of cubes; r is
  the number of the last shell whose mean certainty is below that of the one before.
- H is how far the share of free voxels in a window is from ½, twice: near 0 at a flat wall, ½ at a
  right-angled corner, near 1 at a post; what is unknown is not free. w counts from 1 to `LARGEST`, and is
  divided by it.
"""

from __future__ import annotations

from entropy_explore_env.belief.fields import occupancy_probability
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import lean_kernel

LARGEST = 3
"""Radius of the largest window and shell, in voxels."""
_OCCUPIED = 0.5


@lean_kernel
def landmark_score(belief, prior, voxel):
    """Return the FEF of a voxel, from 0 to 2.

    Args:
        prior: Precision of a voxel that was never measured, float32.
    """
    x, y, z = grid_index(belief.size, voxel)
    if belief.precision[voxel] <= prior:
        return 0.0
    occupied = occupancy_probability(float(belief.mean[voxel]), float(belief.precision[voxel]))
    if occupied <= _OCCUPIED:
        return 0.0
    certainty, radius, descends = 2.0 * occupied - 1.0, 1, True
    free, voxels, contrast, window, grows = 0, 1, 0.0, 0, True
    for shell in range(1, LARGEST + 1):
        total, count = 0.0, 0
        for i in range(max(x - shell, 0), min(x + shell, belief.size[0] - 1) + 1):
            for j in range(max(y - shell, 0), min(y + shell, belief.size[1] - 1) + 1):
                for k in range(max(z - shell, 0), min(z + shell, belief.size[2] - 1) + 1):
                    if max(abs(i - x), abs(j - y), abs(k - z)) != shell:
                        continue
                    near = flat_index(belief.size, i, j, k)
                    count += 1
                    voxels += 1
                    if belief.precision[near] <= prior:
                        continue
                    p = occupancy_probability(float(belief.mean[near]), float(belief.precision[near]))
                    total += abs(2.0 * p - 1.0)
                    free += int(p < _OCCUPIED)
        mean = total / count if count > 0 else 0.0
        if descends and count > 0 and mean < certainty:
            radius, certainty = shell, mean
        else:
            descends = False
        here = abs(2.0 * free / voxels - 1.0) if free > 0 else 0.0
        if grows and here >= contrast:
            contrast, window = here, shell
        else:
            grows = False
    return occupied / radius + contrast * window / LARGEST
