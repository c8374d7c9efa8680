"""An office, corridors and a cluttered hall under one roof (Sawhney's hybrids).

The paper gives no plans; here one of the three takes the larger half and the others share the rest.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.components import largest_component
from entropy_explore_env.worlds.recipes.connectivity import body_room, cut_gates, fill_pockets
from entropy_explore_env.worlds.recipes.corridor import corridor_plan
from entropy_explore_env.worlds.recipes.obstacles import cluttered_plan
from entropy_explore_env.worlds.recipes.office import office_plan
from entropy_explore_env.worlds.recipes.plan import Rectangle, bare_plan, extruded, require_size
from entropy_explore_env.worlds.world import World

_KINDS = ("office", "corridor", "cluttered")
_GATE_M = 1.2
_GATES = 2


def hybrid(grid: Grid, rng: np.random.Generator) -> World:
    """Make three kinds of world side by side, with two gates of 1.2 m between neighbours."""
    require_size(grid, "a hybrid of three worlds", 20.0, 16.0)
    plan = bare_plan(grid.shape, grid.voxel_size_m)
    plan.solid[:] = True
    regions = _regions(plan.whole, plan.wall, rng)
    for kind, region in zip(rng.permutation(_KINDS), regions, strict=True):
        shape = (region.extent(0), region.extent(1))
        if kind == "cluttered":
            part, _ = cluttered_plan(shape, grid.voxel_size_m, rng)
        else:
            draw = office_plan if kind == "office" else corridor_plan
            part = draw(shape, grid.voxel_size_m, rng).solid
        plan.solid[region.window] = part
    rooms = [_free_component(plan.solid, region, grid.voxel_size_m) for region in regions]
    for one, other in ((0, 1), (0, 2), (1, 2)):
        cut_gates(plan.solid, rooms[one], rooms[other], _GATES, _GATE_M, grid.voxel_size_m, rng)
    return World(grid, extruded(grid, fill_pockets(plan.solid, grid.voxel_size_m)), "hybrid")


def _regions(whole: Rectangle, wall: int, rng: np.random.Generator) -> list[Rectangle]:
    """Return one part of about half the plan, and the two parts of the other half."""
    axis = 0 if whole.extent(0) >= whole.extent(1) else 1
    cut = round(whole.extent(axis) * rng.uniform(0.46, 0.54))
    across = round(whole.extent(1 - axis) * rng.uniform(0.46, 0.54))
    half, rest = whole.within(axis, 0, cut), whole.within(axis, cut + wall, whole.high[axis])
    if rng.random() < 0.5:
        half, rest = whole.within(axis, cut + wall, whole.high[axis]), whole.within(axis, 0, cut)
    return [
        half,
        rest.within(1 - axis, 0, across),
        rest.within(1 - axis, across + wall, whole.high[1 - axis]),
    ]


def _free_component(solid: np.ndarray, region: Rectangle, voxel_size_m: float) -> np.ndarray:
    """Return (X, Y) bool, the largest part of where a body fits in a region, whose edge counts as wall."""
    room = np.zeros_like(solid)
    room[region.window] = largest_component(body_room(solid[region.window], voxel_size_m))
    return room
