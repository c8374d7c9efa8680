"""Bhattacharya's large cluttered map, 1000 × 783 cells: a building of many rooms full of obstacles.

The paper (fig. 6) says "a large (1000 × 783 uniformly discretized) cluttered environment" with "the room
in the lower left", from which four robots begin, and unreachable regions. Cells are taken to be 0.1 m.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.connectivity import fill_pockets
from entropy_explore_env.worlds.recipes.convex import scatter
from entropy_explore_env.worlds.recipes.plan import Plan, Rectangle, bare_plan, extruded, require_size, voxels
from entropy_explore_env.worlds.world import World

_WALL_M = 0.4
_LEAST_ROOM_M = 7.0
_LARGEST_ROOM_M = 18.0
_RADII_M = (0.4, 1.6)
_SHARE = 0.08
_TRIES = 20
_FREE_BEFORE_DOORS_M = 1.0
"""Around the passage through a door, so that no obstacle blocks a door in a corner."""


def bhattacharya_cluttered(grid: Grid, rng: np.random.Generator) -> World:
    """Rooms within rooms, one or two doors in each wall, obstacles in all of them.

    All free space in which a body of 0.3 m radius fits is connected; what it cannot reach is solid. Robots
    start anywhere in it, not only in the room in the lower left.

    Args:
        grid: The workspace, at least 20 × 16 m; in 3-D, everything is as high as the workspace.
        rng: Draws walls, doors and obstacles.

    Raises:
        WorldError: The grid is too small.
    """
    require_size(grid, "rooms full of clutter", 20.0, 16.0)
    plan = bare_plan(grid.shape, grid.voxel_size_m, _WALL_M)
    _split(plan, plan.whole, rng)
    around = 2 * voxels(_FREE_BEFORE_DOORS_M, grid.voxel_size_m) + 1
    excluded = ndimage.maximum_filter(plan.clear, around)
    scatter(plan.solid, excluded, _RADII_M, _SHARE, grid.voxel_size_m, rng)
    occupied = extruded(grid, fill_pockets(plan.solid, grid.voxel_size_m))
    return World(grid, occupied, "bhattacharya-cluttered")


def _split(plan: Plan, space: Rectangle, rng: np.random.Generator) -> None:
    """Divide a space by a wall with doors, and its halves in turn, until rooms are small enough."""
    axis = 0 if space.extent(0) >= space.extent(1) else 1
    least = voxels(_LEAST_ROOM_M, plan.voxel_size_m)
    length, wall = space.extent(axis), plan.wall
    enough = rng.uniform(2.0 * _LEAST_ROOM_M, _LARGEST_ROOM_M) / plan.voxel_size_m
    if length < enough or length < 2 * least + wall:
        plan.rooms.append(space)
        return
    for _ in range(_TRIES):
        cut = int(rng.integers(space.low[axis] + least, space.high[axis] - least - wall + 1))
        wall_here = space.within(axis, cut, cut + wall)
        if not plan.clear[wall_here.window].any():
            break
    else:
        plan.rooms.append(space)
        return
    plan.put_wall(wall_here)
    for _ in range(int(rng.integers(1, 3))):
        plan.cut_door(wall_here, 1 - axis, rng)
    _split(plan, space.within(axis, space.low[axis], cut), rng)
    _split(plan, space.within(axis, cut + wall, space.high[axis]), rng)
