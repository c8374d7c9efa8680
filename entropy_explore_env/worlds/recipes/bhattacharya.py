"""Bhattacharya's maps: an office around a ring of corridor, and a building of many rooms full of obstacles.

Of the office (figs. 2-3) the paper says no more than "an office environment, 170 × 200 uniformly
discretized", a workspace that is not convex; here it is a core of rooms, a corridor of 1.6 m around it, and
rooms along the outer walls. Of the other one (fig. 6) it says "a large (1000 × 783 uniformly discretized)
cluttered environment" with "the room in the lower left", from which four robots begin, and unreachable
regions. Cells are taken to be 0.1 m.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.connectivity import fill_pockets
from entropy_explore_env.worlds.recipes.obstacles import scatter
from entropy_explore_env.worlds.recipes.plan import (
    Plan,
    Rectangle,
    bare_plan,
    extruded,
    passage_voxels,
    put_rooms,
    require_size,
    voxels,
)
from entropy_explore_env.worlds.world import World

_CORRIDOR_M = 1.6
_DEPTH_SHARE = (0.2, 0.26)
"""Depth of the outer rooms, as a share of the workspace's side."""
_ROOM_M = 4.2
_WALL_M = 0.4
_LEAST_ROOM_M = 7.0
_LARGEST_ROOM_M = 18.0
_RADII_M = (0.4, 1.6)
_SHARE = 0.08
_TRIES = 20
_FREE_BEFORE_DOORS_M = 1.0
"""Around the passage through a door, so that no obstacle blocks a door in a corner."""


def bhattacharya_office(grid: Grid, rng: np.random.Generator) -> World:
    """Return an office with a corridor that runs in a ring.

    In 3-D, doors have lintels.
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


def bhattacharya_cluttered(grid: Grid, rng: np.random.Generator) -> World:
    """Make rooms within rooms, with one or two doors in each wall and obstacles in all rooms.

    All free space in which a body of 0.3 m radius fits is connected; what it cannot reach is solid. Robots
    start anywhere in it, not only in the room in the lower left.
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
