"""Sujan's planar world: 100 × 100 m of open ground with convex occlusions (fig. 17).

The paper shows black occlusions and says that robots start in the middle; it gives neither sizes nor
number. Here polygons of 3-16 m cover about 12 % of the ground, none within 3 m of the middle.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.connectivity import fill_pockets
from entropy_explore_env.worlds.recipes.convex import scatter
from entropy_explore_env.worlds.recipes.plan import extruded, require_size
from entropy_explore_env.worlds.world import World

_RADII_M = (1.5, 8.0)
_SHARE = 0.12
_OPEN_MIDDLE_M = 3.0


def occlusions(grid: Grid, rng: np.random.Generator) -> World:
    """Convex occlusions on a plane; they are as high as the workspace where it is 3-D.

    All free space in which a body of 0.3 m radius fits is connected. Robots start anywhere in it; the
    paper's start, the middle, is always free.

    Args:
        grid: The workspace, at least 40 × 40 m.
        rng: Draws the occlusions.

    Raises:
        WorldError: The grid is too small.
    """
    require_size(grid, "occlusions of up to 16 m", 40.0, 40.0)
    offsets = [np.arange(n) + 0.5 - 0.5 * n for n in grid.shape[:2]]
    middle = np.hypot(offsets[0][:, None], offsets[1]) * grid.voxel_size_m <= _OPEN_MIDDLE_M
    solid = np.zeros(grid.shape[:2], bool)
    scatter(solid, middle, _RADII_M, _SHARE, grid.voxel_size_m, rng)
    return World(grid, extruded(grid, fill_pockets(solid, grid.voxel_size_m)), "occlusions")
