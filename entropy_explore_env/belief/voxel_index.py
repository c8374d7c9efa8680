"""Numbers of voxels: C order over (x, y, z), z fastest."""

from __future__ import annotations

from entropy_explore_env.compilation.kernels import inlined_kernel


@inlined_kernel
def flat_index(size, x, y, z):
    """Return the number of the voxel with the indices (x, y, z) in a grid of (X, Y, Z) voxels."""
    return (x * size[1] + y) * size[2] + z


@inlined_kernel
def grid_index(size, voxel):
    """Return the indices (x, y, z) of a voxel by its number.

    Without a division: (v + ½)/Z is never so near to a whole number that rounding could reach it.
    """
    column = int((voxel + 0.5) * (1.0 / size[2]))
    row = int((column + 0.5) * (1.0 / size[1]))
    return row, column - row * size[1], voxel - column * size[2]
