"""Fractal terrain, solid below its surface, under an exposure surface that robots stay below (Sawhney).

Sawhney's worlds are height maps "with varying degrees of undulations" under an exposure surface, a height
field known beforehand; neither is given. Here the ground is spectral fractal noise, and the exposure
surface a smoothed hull of the ground with 4 m of air above the ground or more. Lengths in metres.
Its roughness is that of its Hurst exponent: 0.8, and 0.95 and 0.5 for a smoother and a rougher one.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.fractal import fractal_noise
from entropy_explore_env.worlds.recipes.plan import BODY_RADIUS_M, passage_voxels
from entropy_explore_env.worlds.world import World

_HURST, _SMOOTH, _ROUGH = 0.8, 0.95, 0.5
_STEEP = 0.25
"""Most height of the relief, as a share of the shorter side."""
_AIR_M = 4.0
_HULL_M = 6.0
"""The hull takes the highest ground within this distance along either axis."""


def smooth_terrain(grid: Grid, rng: np.random.Generator) -> World:
    """Make gentler hills; see `terrain`."""
    return _ground(grid, rng, _SMOOTH, "terrain-smooth")


def rough_terrain(grid: Grid, rng: np.random.Generator) -> World:
    """Make rugged hills; see `terrain`."""
    return _ground(grid, rng, _ROUGH, "terrain-rough")


def terrain(grid: Grid, rng: np.random.Generator) -> World:
    """Make hills and valleys below a ceiling for robots, with open sky above it.

    The space between ground and ceiling in which a body of 0.3 m radius fits is connected, and so is
    all free space.
    """
    return _ground(grid, rng, _HURST, "terrain")


def _ground(grid: Grid, rng: np.random.Generator, hurst: float, name: str) -> World:
    edge_m, (columns_x, columns_y, layers) = grid.voxel_size_m, grid.shape
    body = passage_voxels(0.0, edge_m)
    air = max(round(_AIR_M / edge_m), body + 2)
    relief = min(_STEEP * grid.size_m[:2].min() / edge_m, layers - air - 1.0)
    if grid.flat or min(grid.size_m[:2]) < 6.0 or relief < 1.0:
        high = f"{(air + 2) * edge_m:g} m"
        raise WorldError("Grid.shape", grid.shape, f"3-D, at least 6 × 6 m and {high} high for terrain")
    noise = fractal_noise((columns_x, columns_y), hurst, rng)
    heights = 1.0 + relief * (noise - noise.min()) / max(np.ptp(noise), 1e-9)
    ground = np.rint(heights).astype(np.int32)
    occupied = np.arange(layers) < ground[:, :, None]
    return World(grid, occupied, name, exposure_surface(ground, layers, air, edge_m))


def exposure_surface(ground: np.ndarray, layers: int, air: int, voxel_size_m: float) -> np.ndarray:
    """Return the lowest layer of each column that robots must not enter.

    Args:
        ground: (X, Y) int32, solid layers of each column.
        layers: Z, an upper limit of the surface.
        air: Least number of free layers between ground and surface.
        voxel_size_m: Edge of a voxel.

    Returns:
        (X, Y) int32: at least `air` above the ground of all columns that a body reaches from two
        neighbouring columns, so that robots can fly over every pass.
    """
    reach = int(np.ceil(BODY_RADIUS_M / voxel_size_m - 0.5 - 1e-9))
    needed = ndimage.maximum_filter(ground, 4 * max(reach, 0) + 3, mode="nearest") + air
    wide = 2 * round(_HULL_M / voxel_size_m) + 1
    hull = ndimage.maximum_filter(ground, wide, mode="nearest").astype(np.float64) + air
    smooth = ndimage.gaussian_filter(hull, 0.5 * _HULL_M / voxel_size_m, mode="nearest")
    return np.minimum(np.maximum(needed, np.floor(smooth)), layers).astype(np.int32)
