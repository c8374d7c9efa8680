"""Bhattacharya's office, 170 × 200 cells: a corridor around a core of rooms, rooms along the outer walls.

The paper (figs. 2-3) says no more than "an office environment, 170 × 200 uniformly discretized", a
workspace that is not convex. Cells are taken to be 0.1 m, the corridor 1.6 m wide.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.plan import (
    bare_plan,
    extruded,
    passage_voxels,
    put_rooms,
    require_size,
)
from entropy_explore_env.worlds.world import World

_CORRIDOR_M = 1.6
_DEPTH_SHARE = (0.2, 0.26)
"""Depth of the outer rooms, as a share of the workspace's side."""
_ROOM_M = 4.2


def bhattacharya_office(grid: Grid, rng: np.random.Generator) -> World:
    """Return an office with a corridor that runs in a ring.

    All free space in which a body of 0.3 m radius fits is connected. In 3-D, doors have lintels.

    Args:
        grid: The workspace, at least 14 × 12 m.
        rng: Draws walls and doors.

    Raises:
        WorldError: The grid is too small.
    """
    require_size(grid, "an office around a ring", 14.0, 12.0)
    plan = bare_plan(grid.shape, grid.voxel_size_m)
    corridor, wall, (x, y) = passage_voxels(_CORRIDOR_M, grid.voxel_size_m), plan.wall, plan.solid.shape
    depths = rng.uniform(*_DEPTH_SHARE, 4)
    west, east = round(depths[0] * x), x - round(depths[1] * x)
    south, north = round(depths[2] * y), y - round(depths[3] * y)
    whole = plan.whole
    plan.put_wall(whole.within(1, south - wall, south))
    plan.put_wall(whole.within(1, north, north + wall))
    along = whole.within(0, west, east)  # the first and the last room reach around the corner
    put_rooms(plan, along.within(1, 0, south), 0, True, _ROOM_M, rng)
    put_rooms(plan, along.within(1, north, y), 0, False, _ROOM_M, rng)
    sides = whole.within(1, south, north)
    put_rooms(plan, sides.within(0, 0, west), 1, True, _ROOM_M, rng)
    put_rooms(plan, sides.within(0, east, x), 1, False, _ROOM_M, rng)
    core = whole.within(0, west + corridor, east - corridor).within(1, south + corridor, north - corridor)
    plan.put_wall(core)
    inside = core.within(1, core.low[1] + wall, core.high[1] - wall)
    plan.solid[inside.window] = False
    middle = (core.low[0] + core.high[0]) // 2
    put_rooms(plan, inside.within(0, core.low[0], middle), 1, False, _ROOM_M, rng)
    put_rooms(plan, inside.within(0, middle + wall, core.high[0]), 1, True, _ROOM_M, rng)
    plan.put_wall(core.within(0, middle, middle + wall))
    return World(grid, extruded(grid, plan.solid, plan.doors), "bhattacharya-office")
