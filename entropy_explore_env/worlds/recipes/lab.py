"""RochaMI's laboratory: one room of 23 m² for ground robots, ε = 0.1 m.

The paper gives area and resolution, not the plan; here the room is 5.0 × 4.6 × 2.0 m (scenario `lab`) with
benches and cupboards along its walls and boxes between them.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.connectivity import fill_pockets
from entropy_explore_env.worlds.recipes.furniture import LABORATORY, furnish
from entropy_explore_env.worlds.recipes.plan import bare_plan, extruded, require_size
from entropy_explore_env.worlds.world import World

_AREA_A_PIECE_M2 = 3.0


def lab(grid: Grid, rng: np.random.Generator) -> World:
    """Return a room with benches, cupboards and boxes.

    All free space in which a body of 0.3 m radius fits is connected, in space and in every layer.

    Args:
        grid: The workspace, at least 4 × 3 m.
        rng: Draws the furniture.

    Raises:
        WorldError: The grid is too small.
    """
    require_size(grid, "a laboratory", 4.0, 3.0)
    plan = bare_plan(grid.shape, grid.voxel_size_m)
    occupied = extruded(grid, plan.solid)
    furnish(occupied, plan, plan.whole, LABORATORY, _AREA_A_PIECE_M2, rng)
    return World(grid, fill_pockets(occupied, grid.voxel_size_m), "lab")
