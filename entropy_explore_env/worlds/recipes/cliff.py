"""A plateau that ends in a vertical drop, and rough ground with rock piles below it (Sujan, fig. 23).

The paper's sandpit is "recessed" and holds "several rock piles"; its edge is the cliff's, and its left part
gives no stereo returns. It gives no sizes. Here the plateau is 3 m above the workspace's floor and level, so
that a rover keeps its height on it; the edge is a polyline that turns in and out; the ground below is
fractal. A band of it at one end of the cliff is smooth, without rocks, and unreadable. Rocks are of the sizes
that Golombek & Rapp (1997) found at the site of the second Viking lander (`rocks`), half of them in piles.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.fractal import fractal_noise
from entropy_explore_env.worlds.recipes.plan import require_size
from entropy_explore_env.worlds.recipes.rocks import VIKING_2, RockSizes, draw_diameters, raise_rocks
from entropy_explore_env.worlds.world import World

PLATEAU_M = 3.0
"""Height of the plateau above the workspace's floor."""
_AIR_M = 1.5
"""Least height of the workspace above the plateau."""
_LARGEST_VOXEL_M = 0.5
_EDGE_AT = 0.4
"""Share of the workspace along x that the plateau takes on average."""
_TURN_M, _BEND_M = (1.2, 2.5), (0.3, 1.0)
"""Distance between corners of the edge, and by how much they lie before and behind its mean in turn."""
_GROUND_M, _RELIEF_M, _HURST = 0.6, 0.12, 0.8
"""Mean height of the ground below, its standard deviation, and how smooth it is."""
_GAP_M = 0.5
"""Rocks end so far below the plateau."""
_UNREADABLE_SHARE = 0.3
"""Of the cliff's length."""
_LARGEST_ROCK_M = 1.5
_PILED, _PILE_M, _PILES_PER_M2 = 0.5, 0.4, 0.04
"""Share of rocks in piles, standard deviation of their places, and number of piles."""


def cliff(grid: Grid, rng: np.random.Generator) -> World:
    """Return a plateau for x below the edge, rough ground beyond; all free space is connected."""
    require_size(grid, "a cliff", 8.0, 6.0)
    if grid.voxel_size_m > _LARGEST_VOXEL_M:
        raise WorldError("Grid.voxel_size_m", grid.voxel_size_m, f"at most {_LARGEST_VOXEL_M:g} for a cliff")
    if grid.size_m[2] < PLATEAU_M + _AIR_M - 1e-9:
        raise WorldError("Grid.shape", grid.shape, f"3-D, at least {PLATEAU_M + _AIR_M:g} m high for a cliff")
    edge_m, (columns_x, columns_y, layers) = grid.voxel_size_m, grid.shape
    plateau = (np.arange(columns_x) + 0.5)[:, None] * edge_m < _edge_line(grid, rng)
    height_m = _GROUND_M + _RELIEF_M * fractal_noise((columns_x, columns_y), _HURST, rng)
    band = np.zeros((columns_x, columns_y), bool)
    width = round(_UNREADABLE_SHARE * columns_y)
    band[:, :width] = True
    if rng.random() < 0.5:
        band = band[:, ::-1]
    height_m[band] = _GROUND_M
    _scatter_rocks(height_m, ~plateau & ~band, edge_m, rng)
    height_m = np.minimum(height_m, PLATEAU_M - _GAP_M)
    height_m[band & ~plateau] = _GROUND_M  # nothing of a rock beside it
    ground = np.asarray(np.maximum(np.rint(height_m / edge_m), 1), np.int32)
    ground[plateau] = round(PLATEAU_M / edge_m)
    occupied = np.arange(layers) < ground[:, :, None]
    return World(grid, occupied, "cliff", unreadable=occupied & (band & ~plateau)[:, :, None])


def _edge_line(grid: Grid, rng: np.random.Generator) -> np.ndarray:
    """Return (Y,) where along x the plateau ends, in metres, for each row of columns: a polyline."""
    length_m, middle_m = float(grid.size_m[1]), _EDGE_AT * float(grid.size_m[0])
    corners = [-rng.uniform(*_TURN_M)]
    while corners[-1] < length_m:
        corners.append(corners[-1] + rng.uniform(*_TURN_M))
    bends = rng.uniform(*_BEND_M, len(corners))
    offsets = np.where(np.arange(len(corners)) % 2 == rng.integers(2), bends, -bends)
    rows = (np.arange(grid.shape[1]) + 0.5) * grid.voxel_size_m
    return middle_m + np.interp(rows, corners, offsets)


def _scatter_rocks(height_m: np.ndarray, rocky: np.ndarray, edge_m: float, rng: np.random.Generator) -> None:
    """Raise rocks where `rocky` (X, Y) says, in place; what falls out of a pile's ground lies elsewhere."""
    places = np.argwhere(rocky)
    area_m2 = len(places) * edge_m**2
    sizes = RockSizes(VIKING_2, 2.0 * edge_m, max(_LARGEST_ROCK_M, 3.0 * edge_m))
    diameters = draw_diameters(sizes, area_m2, rng)
    centres = (places[rng.integers(len(places), size=len(diameters))] + 0.5) * edge_m
    piles = (places[rng.integers(len(places), size=max(round(_PILES_PER_M2 * area_m2), 1))] + 0.5) * edge_m
    piled = piles[rng.integers(len(piles), size=len(diameters))]
    piled = piled + _PILE_M * rng.standard_normal(piled.shape)
    columns = np.floor(piled / edge_m).astype(int)
    inside = np.all((columns >= 0) & (columns < rocky.shape), axis=1)
    inside[inside] = rocky[tuple(columns[inside].T)]
    in_piles = inside & (rng.random(len(diameters)) < _PILED)
    centres[in_piles] = piled[in_piles]
    raise_rocks(height_m, diameters, centres, edge_m)
