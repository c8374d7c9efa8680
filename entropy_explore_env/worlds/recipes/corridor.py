"""Corridors through solid rock or building: a net of straight passages with crossings and dead ends.

Sawhney explores "corridor" worlds and gives no plans; here corridors are 1.2, 1.6 or 2.4 m wide and about
5 m apart, a spanning tree of a lattice with a quarter of its other edges.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.plan import (
    Plan,
    Rectangle,
    bare_plan,
    divided,
    extruded,
    passage_voxels,
    require_size,
)
from entropy_explore_env.worlds.world import World

_SPACING_M = 5.0
_WIDTHS_M = (1.2, 1.2, 1.6, 2.4)
_LOOPS = 0.25
"""Share of the edges outside the spanning tree that are open, too."""


def corridor(grid: Grid, rng: np.random.Generator) -> World:
    """Return a net of corridors; all of it is connected for a body of 0.3 m radius."""
    require_size(grid, "corridors", 8.0, 4.0)
    plan = corridor_plan((grid.shape[0], grid.shape[1]), grid.voxel_size_m, rng)
    return World(grid, extruded(grid, plan.solid), "corridor")


def corridor_plan(shape: tuple[int, int], voxel_size_m: float, rng: np.random.Generator) -> Plan:
    """Return the floor plan of a net of corridors.

    Args:
        shape: Voxels along x and y, at least 4 m each, one of them 8 m.
        voxel_size_m: Edge of a voxel.
        rng: Draws everything.
    """
    plan = bare_plan(shape, voxel_size_m)
    plan.solid[:] = True
    lanes = [
        [(low + high) // 2 for low, high in divided(0, n, _SPACING_M / voxel_size_m, 0, rng)] for n in shape
    ]
    nodes = [(i, j) for i in range(len(lanes[0])) for j in range(len(lanes[1]))]
    edges = [((i, j), (i + 1, j)) for i, j in nodes if i + 1 < len(lanes[0])]
    edges += [((i, j), (i, j + 1)) for i, j in nodes if j + 1 < len(lanes[1])]
    joined = {node: {node} for node in nodes}
    for number in rng.permutation(len(edges)):
        start, end = edges[number]
        apart = joined[start] is not joined[end]
        width = passage_voxels(_WIDTHS_M[int(rng.integers(len(_WIDTHS_M)))], voxel_size_m)
        if not apart and rng.random() >= _LOOPS:
            continue
        low, high = ([lanes[i][node[i]] - width // 2 for i in (0, 1)] for node in (start, end))
        opened = Rectangle(
            (max(0, low[0]), max(0, low[1])),
            (min(shape[0], high[0] + width), min(shape[1], high[1] + width)),
        )
        plan.solid[opened.window] = False
        if apart:
            joined[start] |= joined[end]
            for node in joined[end]:
                joined[node] = joined[start]
    return plan
