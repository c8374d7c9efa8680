"""A hall full of convex obstacles of all sizes (Sawhney's cluttered, unstructured worlds).

The paper gives no plans; here polygons of 0.6-3 m cover about 15 % of the floor.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.connectivity import fill_pockets
from entropy_explore_env.worlds.recipes.convex import scatter
from entropy_explore_env.worlds.recipes.plan import require_size
from entropy_explore_env.worlds.world import World

_RADII_M = (0.3, 1.5)
_SHARE = 0.15
_HEIGHTS_M = (0.5, 3.0)


def cluttered(grid: Grid, rng: np.random.Generator) -> World:
    """Obstacles scattered over a floor; in 3-D each has a height of its own.

    All free space in which a body of 0.3 m radius fits is connected.

    Args:
        grid: The workspace, at least 6 × 5 m.
        rng: Draws the obstacles.

    Raises:
        WorldError: The grid is too small.
    """
    require_size(grid, "clutter", 6.0, 5.0)
    solid, numbers = cluttered_plan((grid.shape[0], grid.shape[1]), grid.voxel_size_m, rng)
    if grid.flat:
        return World(grid, solid[:, :, None], "cluttered")
    heights = rng.uniform(*_HEIGHTS_M, numbers.max() + 1)[numbers]
    heights = np.where(numbers > 0, heights, np.where(solid, np.inf, 0.0))
    occupied = (np.arange(grid.shape[2]) + 0.5) * grid.voxel_size_m < heights[:, :, None]
    return World(grid, fill_pockets(occupied, grid.voxel_size_m), "cluttered")


def cluttered_plan(
    shape: tuple[int, int], voxel_size_m: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Solid voxels (X, Y) bool, and the number of the obstacle in each voxel, (X, Y) int32."""
    solid = np.zeros(shape, bool)
    numbers = scatter(solid, np.zeros(shape, bool), _RADII_M, _SHARE, voxel_size_m, rng)
    return fill_pockets(solid, voxel_size_m), numbers
