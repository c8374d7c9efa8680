"""Convex obstacles, far enough apart for a body to pass between them, and the worlds that are made of them.

Sawhney's cluttered, unstructured worlds: the paper gives no plans; here polygons of 0.6-3 m cover about 15 %
of a hall's floor. Sujan's planar world (fig. 17) is 100 × 100 m of open ground with black occlusions; the
paper says that robots start in the middle, and gives neither sizes nor number. Here polygons of 3-16 m cover
about 12 % of the ground, none within 3 m of the middle.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.connectivity import fill_pockets
from entropy_explore_env.worlds.recipes.plan import BODY_RADIUS_M, extruded, require_size
from entropy_explore_env.worlds.world import World

_MAX_FAILURES = 60
"""After this many failures in a row the plan counts as full."""
_CLUTTER_M = (0.3, 1.5)
_CLUTTERED = 0.15
_HEIGHTS_M = (0.5, 3.0)
_OCCLUSIONS_M = (1.5, 8.0)
_OCCLUDED = 0.12
_OPEN_MIDDLE_M = 3.0


def clearance_voxels(voxel_size_m: float) -> float:
    """Return how far apart solid voxels' centres let a body pass in any direction, in voxel edges."""
    return 2.0 * BODY_RADIUS_M / voxel_size_m + 2.5


def scatter(
    solid: np.ndarray,
    excluded: np.ndarray,
    radii_m: tuple[float, float],
    share: float,
    voxel_size_m: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Put convex polygons on a plan until they cover a share of it, or there is no room for another.

    Each polygon has 3-8 corners on an ellipse, one semi-axis from `radii_m`, the other half as long or
    longer. Polygons keep the clearance from each other, but not from voxels that are solid already: they
    may touch walls.

    Args:
        solid: (X, Y) bool; changed in place.
        excluded: (X, Y) bool, where no polygon may be.
        radii_m: Smallest and largest semi-axis.
        share: Of the free area, at least 0 and below about 0.3.
        voxel_size_m: Edge of a voxel.
        rng: Draws the polygons.

    Returns:
        (X, Y) int32: number of the polygon, from 1; 0 elsewhere.
    """
    numbers = np.zeros(solid.shape, np.int32)
    wanted, covered, failures = share * (~solid).sum(), 0, 0
    clearance = clearance_voxels(voxel_size_m)
    while covered < wanted and failures < _MAX_FAILURES:
        failures += 1
        longest = rng.uniform(*radii_m) / voxel_size_m
        centre = rng.uniform(0.0, solid.shape)
        middle = int(centre[0]), int(centre[1])
        if solid[middle] or numbers[middle]:
            continue
        normals, offsets = _polygon(longest, rng)
        reach = longest + clearance + 1.0
        low = np.maximum(np.floor(centre - reach), 0).astype(int)
        high = np.minimum(np.ceil(centre + reach), solid.shape).astype(int)
        window = (slice(low[0], high[0]), slice(low[1], high[1]))
        x, y = (np.arange(low[i], high[i]) + 0.5 - centre[i] for i in (0, 1))
        outside = np.full((len(x), len(y)), -np.inf)
        for normal, offset in zip(normals, offsets, strict=True):
            np.maximum(outside, normal[0] * x[:, None] + normal[1] * y - offset, out=outside)
        inside = outside <= 0.0
        if numbers[window][outside <= clearance].any() or excluded[window][inside].any():
            continue
        inside &= ~solid[window]
        if inside.any():
            numbers[window][inside] = numbers.max() + 1
            covered, failures = covered + int(inside.sum()), 0
    solid |= numbers > 0
    return numbers


def _polygon(longest: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return outward normals (N, 2) and offsets (N,) of the edges: normal · point ≤ offset inside."""
    corners = int(rng.integers(3, 9))
    angles = (np.arange(corners) + rng.uniform(0.0, 0.7, corners)) * (2.0 * math.pi / corners)
    turn, flat = rng.uniform(0.0, math.pi), rng.uniform(0.5, 1.0)
    points = longest * np.stack([np.cos(angles), flat * np.sin(angles)], axis=1)
    cos, sin = math.cos(turn), math.sin(turn)
    points = np.stack([points[:, 0] * cos - points[:, 1] * sin, points[:, 0] * sin + points[:, 1] * cos], 1)
    edges = np.roll(points, -1, axis=0) - points
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, (normals * points).sum(axis=1)


def cluttered(grid: Grid, rng: np.random.Generator) -> World:
    """Scatter obstacles over a floor; in 3-D each has a height of its own."""
    require_size(grid, "clutter", 6.0, 5.0)
    solid, numbers = cluttered_plan((grid.shape[0], grid.shape[1]), grid.voxel_size_m, rng)
    if grid.flat:
        return World(grid, solid[:, :, None], "cluttered")
    heights = rng.uniform(*_HEIGHTS_M, numbers.max() + 1)[numbers]
    heights = np.where(numbers > 0, heights, np.where(solid, np.inf, 0.0))
    occupied = (np.arange(grid.shape[2]) + 0.5) * grid.voxel_size_m < heights[:, :, None]
    return World(grid, fill_pockets(occupied, grid.voxel_size_m), "cluttered")


def cluttered_plan(
    shape: tuple[int, int], voxel_size_m: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return solid voxels (X, Y) bool, and the number of the obstacle in each voxel, (X, Y) int32."""
    solid = np.zeros(shape, bool)
    numbers = scatter(solid, np.zeros(shape, bool), _CLUTTER_M, _CLUTTERED, voxel_size_m, rng)
    return fill_pockets(solid, voxel_size_m), numbers


def occlusions(grid: Grid, rng: np.random.Generator) -> World:
    """Make convex occlusions on a plane; they are as high as the workspace where it is 3-D.

    Robots start anywhere in it; the paper's start, the middle, is always free.
    """
    require_size(grid, "occlusions of up to 16 m", 40.0, 40.0)
    offsets = [np.arange(n) + 0.5 - 0.5 * n for n in grid.shape[:2]]
    middle = np.hypot(offsets[0][:, None], offsets[1]) * grid.voxel_size_m <= _OPEN_MIDDLE_M
    solid = np.zeros(grid.shape[:2], bool)
    scatter(solid, middle, _OCCLUSIONS_M, _OCCLUDED, grid.voxel_size_m, rng)
    return World(grid, extruded(grid, fill_pockets(solid, grid.voxel_size_m)), "occlusions")
