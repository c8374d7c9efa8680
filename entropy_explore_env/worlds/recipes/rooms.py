"""Single rooms: empty (Rocha04's), with boxes on the floor, and RochaMI's laboratory.

RochaMI gives area and resolution of its laboratory, 23 m² at ε = 0.1 m, not the plan; here it is a room of
5.0 × 4.6 × 2.0 m (scenario `lab`) with benches and cupboards along its walls and boxes between them.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.components import connected_components
from entropy_explore_env.worlds.recipes.connectivity import fill_pockets
from entropy_explore_env.worlds.recipes.furniture import LABORATORY, furnish
from entropy_explore_env.worlds.recipes.plan import bare_plan, extruded, require_size
from entropy_explore_env.worlds.world import World

_ATTEMPTS = 100
_FURNITURE_SHARE = 0.08
"""Approximate share of the floor that furniture covers."""
_AREA_A_PIECE_M2 = 3.0


def empty(grid: Grid, rng: np.random.Generator) -> World:
    """Return a workspace with nothing in it but its walls; nothing is drawn."""
    del rng
    return World(grid, np.zeros(grid.shape, bool), "empty")


def furnished(grid: Grid, rng: np.random.Generator) -> World:
    """Return a room with boxes on its floor, against each other or alone.

    Its free space is connected, also for bodies with a radius of up to half a voxel; larger ones may not
    reach all of it, and start in the largest component.
    """
    for _ in range(_ATTEMPTS):
        occupied = _boxes(grid, rng)
        _, count = connected_components(~occupied)
        if count == 1 and occupied.any():
            return World(grid, occupied, "furnished")
    raise WorldError("Grid.shape", grid.shape, "a workspace with room for furniture")


def _boxes(grid: Grid, rng: np.random.Generator) -> np.ndarray:
    """Return boxes of 0.5-2 m on the floor, 0.5 m to three quarters of the room high."""
    occupied = np.zeros(grid.shape, bool)
    floor = grid.shape[0] * grid.shape[1]
    while occupied[:, :, 0].sum() < _FURNITURE_SHARE * floor:
        low = np.asarray([0.5, 0.5, 0.5])
        high = np.minimum([2.0, 2.0, 3.0], 0.5 * grid.size_m)
        edges_m = rng.uniform(low, np.maximum(high, low + 1e-9))
        edges = np.clip(np.rint(edges_m / grid.voxel_size_m).astype(int), 1, grid.shape)
        if not grid.flat:
            edges[2] = min(edges[2], max(1, math.floor(0.75 * grid.shape[2])))
        corner = [
            int(rng.integers(0, n - edge + 1)) for n, edge in zip(grid.shape[:2], edges[:2], strict=True)
        ]
        occupied[corner[0] : corner[0] + edges[0], corner[1] : corner[1] + edges[1], : edges[2]] = True
    return occupied


def lab(grid: Grid, rng: np.random.Generator) -> World:
    """Return a room with benches, cupboards and boxes.

    All free space in which a body of 0.3 m radius fits is connected, in space and in every layer.
    """
    require_size(grid, "a laboratory", 4.0, 3.0)
    plan = bare_plan(grid.shape, grid.voxel_size_m)
    occupied = extruded(grid, plan.solid)
    furnish(occupied, plan, plan.whole, LABORATORY, _AREA_A_PIECE_M2, rng)
    return World(grid, fill_pockets(occupied, grid.voxel_size_m), "lab")
