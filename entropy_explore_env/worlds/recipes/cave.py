"""A cave or mine: halls, and winding tunnels between them, in rough rock.

No paper describes one. Halls are ellipsoids with semi-axes of 1.8-3.6 m, about one for 75 m² of plan;
tunnels follow a minimum spanning tree of the halls and a few more short connections. Their radii are 0.5 m
plus 1.8 voxels, and up to 0.8 m more; fractal noise roughens the walls.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.connectivity import fill_pockets
from entropy_explore_env.worlds.recipes.fractal import fractal_noise
from entropy_explore_env.worlds.recipes.plan import BODY_RADIUS_M, require_size
from entropy_explore_env.worlds.world import World

_AREA_A_HALL_M2 = 75.0
_MOST_HALLS = 40
_HALL_RADII_M = (1.8, 3.6)
_TUNNEL_RADII_M = (0.0, 0.8)
"""More than the narrowest tunnel."""
_ROUGH_M = 0.4
_LOOPS = 0.15


def cave(grid: Grid, rng: np.random.Generator) -> World:
    """Make halls and tunnels in rock, at all heights in 3-D; a plan of them in 2-D."""
    require_size(grid, "a cave", 12.0, 10.0)
    narrowest = BODY_RADIUS_M + 1.8 * grid.voxel_size_m + 0.2
    axes = 2 if grid.flat else 3
    room_m = grid.size_m[:axes]
    if room_m.min() < 2.0 * narrowest:
        raise WorldError(
            "Grid.shape", grid.shape, f"at least {2.0 * narrowest:g} m along each axis for a cave"
        )
    beyond = np.full(grid.shape[:axes], np.inf)
    halls, radii = _halls(room_m, narrowest, rng)
    for centre, radius in zip(halls, radii, strict=True):
        _hollow(beyond, centre, radius, grid.voxel_size_m)
    for one, other in _tunnel_ends(halls, rng):
        for point, radius in _tunnel(halls[one], halls[other], narrowest, room_m, rng):
            _hollow(beyond, point, np.full(axes, radius), grid.voxel_size_m)
    rough = np.clip(_ROUGH_M * fractal_noise(beyond.shape, 0.2, rng), -0.2, 2.0 * _ROUGH_M)
    occupied = (beyond >= rough).reshape(grid.shape)
    return World(grid, fill_pockets(occupied, grid.voxel_size_m), "cave")


def _halls(room_m: np.ndarray, narrowest: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return halls' centres and semi-axes, (N, axes) metres each; far from each other, inside the room."""
    count = int(np.clip(round(room_m[0] * room_m[1] / _AREA_A_HALL_M2), 3, _MOST_HALLS))
    margin = np.minimum(narrowest + 1.0, 0.5 * room_m)
    centres = [rng.uniform(margin, room_m - margin)]
    while len(centres) < count:
        candidates = rng.uniform(margin, room_m - margin, (12, len(room_m)))
        gaps = np.linalg.norm(candidates[:, None] - np.array(centres), axis=2).min(axis=1)
        centres.append(candidates[int(gaps.argmax())])
    radii = rng.uniform(*_HALL_RADII_M, (count, len(room_m)))
    if len(room_m) == 3:
        radii[:, 2] *= rng.uniform(0.4, 0.8, count)
    return np.array(centres), np.clip(radii, narrowest, np.maximum(0.3 * room_m, narrowest))


def _tunnel_ends(halls: np.ndarray, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Return the pairs of halls with a tunnel between them."""
    lengths = np.linalg.norm(halls[:, None] - halls, axis=2)
    tree = minimum_spanning_tree(lengths).tocoo()
    pairs = {(min(i, j), max(i, j)) for i, j in zip(tree.row.tolist(), tree.col.tolist(), strict=True)}
    near = 1.6 * float(np.median(tree.data))
    for i, j in np.argwhere(np.triu(lengths < near, 1)).tolist():
        if rng.random() < _LOOPS:
            pairs.add((i, j))
    return sorted(pairs)


def _tunnel(
    start: np.ndarray, end: np.ndarray, narrowest: float, room_m: np.ndarray, rng: np.random.Generator
) -> list[tuple[np.ndarray, float]]:
    """Return points along a winding tunnel, at most half the narrowest radius apart, and their radii."""
    length = float(np.linalg.norm(end - start))
    steps = max(2, math.ceil(2.5 * length / narrowest))
    share = np.linspace(0.0, 1.0, steps)
    waves = np.arange(1, 4)[:, None]
    bends = rng.standard_normal((len(start), 3)) * (0.12 * length / np.arange(1, 4))
    if len(start) == 3:
        bends[2] *= 0.5
    points = start + share[:, None] * (end - start) + (bends @ np.sin(math.pi * waves * share)).T
    points = np.clip(
        points, np.minimum(narrowest, 0.5 * room_m), room_m - np.minimum(narrowest, 0.5 * room_m)
    )
    wide = rng.uniform(*_TUNNEL_RADII_M, 4)
    return list(zip(points, narrowest + np.interp(share, np.linspace(0.0, 1.0, 4), wide), strict=True))


def _hollow(beyond: np.ndarray, centre: np.ndarray, radii: np.ndarray, voxel_size_m: float) -> None:
    """Hollow out an ellipsoid.

    Args:
        beyond: (X, Y, Z) or (X, Y) float64, metres to the nearest hollow, negative inside; changed in place.
        centre: (axes,) metres.
        radii: (axes,) semi-axes in metres.
        voxel_size_m: Edge of a voxel.
    """
    reach = radii + 2.0 * _ROUGH_M
    low = np.maximum(np.floor((centre - reach) / voxel_size_m), 0).astype(int)
    high = np.minimum(np.ceil((centre + reach) / voxel_size_m), beyond.shape).astype(int)
    window = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    squares = 0.0
    for axis, (a, b) in enumerate(zip(low, high, strict=True)):
        away = ((np.arange(a, b) + 0.5) * voxel_size_m - centre[axis]) / radii[axis]
        squares = squares + (away**2).reshape([-1 if other == axis else 1 for other in range(len(low))])
    np.minimum(beyond[window], (np.sqrt(squares) - 1.0) * radii.min(), out=beyond[window])
