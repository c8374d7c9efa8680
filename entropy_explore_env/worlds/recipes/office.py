"""An office: rooms in rows on both sides of corridors, doors, and furniture where the world is 3-D.

Sawhney explores "office like" worlds and gives no plans; this one has the measures of an office building:
corridors of 1.8 m, rooms about 4 m wide and 3-5 m deep, doors of 0.9 × 2.1 m, walls of 0.1 m.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.furniture import OFFICE, furnish
from entropy_explore_env.worlds.recipes.plan import (
    Plan,
    bare_plan,
    divided,
    extruded,
    passage_voxels,
    put_rooms,
    require_size,
    voxels,
)
from entropy_explore_env.worlds.world import World

CORRIDOR_M = 1.8
_ROOM_M = 4.0
_BLOCK_M = 2 * _ROOM_M + CORRIDOR_M
_WING_M = 18.0
"""Length of a row of rooms between two cross corridors, about."""
_LEAST_M = (8.0, 6.0)
_AREA_A_PIECE_M2 = 5.0


def office(grid: Grid, rng: np.random.Generator) -> World:
    """Make rooms along corridors; cross corridors join the corridors where there are several.

    2-D offices are bare; in 3-D ones desks, cupboards, shelves and tables stand in the rooms.
    """
    require_size(grid, "an office", *_LEAST_M)
    plan = office_plan((grid.shape[0], grid.shape[1]), grid.voxel_size_m, rng)
    occupied = extruded(grid, plan.solid, plan.doors)
    if not grid.flat:
        for room in plan.rooms:
            furnish(occupied, plan, room, OFFICE, _AREA_A_PIECE_M2, rng)
    return World(grid, occupied, "office")


def office_plan(shape: tuple[int, int], voxel_size_m: float, rng: np.random.Generator) -> Plan:
    """Return the floor plan of an office; corridors run along its longer side.

    Args:
        shape: Voxels along x and y, at least 6 m each.
        voxel_size_m: Edge of a voxel.
        rng: Draws everything.
    """
    plan = bare_plan(shape, voxel_size_m)
    axis = 0 if shape[0] >= shape[1] else 1
    across, wall = 1 - axis, plan.wall
    corridor = passage_voxels(CORRIDOR_M, voxel_size_m)
    blocks = divided(0, shape[across], _BLOCK_M / voxel_size_m, wall, rng)
    wings = [(0, shape[axis])]
    if len(blocks) > 1:
        wings = _wings(shape[axis], voxels(_WING_M, voxel_size_m), corridor, rng)
    for number, (low, high) in enumerate(blocks):
        depth = (high - low - corridor) / 2.0
        middle = low + round(depth * rng.uniform(0.8, 1.2))
        for wing in wings:
            for rooms, doors_high in (((low, middle), True), ((middle + corridor, high), False)):
                band = plan.whole.within(axis, *wing).within(across, *rooms)
                inner = band.within(
                    axis,
                    wing[0] + (wall if wing[0] else 0),
                    wing[1] - (wall if wing[1] < shape[axis] else 0),
                )
                plan.put_wall(band)
                plan.solid[inner.window] = False
                put_rooms(plan, inner, axis, doors_high, _ROOM_M, rng)
            if number + 1 < len(blocks):
                plan.put_wall(plan.whole.within(axis, *wing).within(across, high, high + wall))
    return plan


def _wings(length: int, wing: int, corridor: int, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Return a building's length cut by cross corridors, at least one, none of them at an end."""
    parts = divided(0, length, wing, corridor, rng)
    if len(parts) > 1:
        return parts
    start = int(rng.integers(round(0.35 * length), round(0.65 * length) + 1)) - corridor // 2
    return [(0, start), (start + corridor, length)]
