"""Geodesic Voronoi cells beside SciPy's Dijkstra.

Both sides get the same steps at the same costs. SciPy's graph is made before the clock starts; ours is the
field of traversal costs itself.
"""

from __future__ import annotations

import numpy as np

from baselines.papers.bhattacharya.measured import beside_scipy
from benchmarks.rows import Effort, Goal, Row, compared
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.catalogue import RECIPES

MAP = Grid((1000, 783, 1), 0.1)
"""The cluttered map of Bhattacharya."""
SOURCES = 4


def maze(shape: tuple[int, int, int], seed: int = 0) -> np.ndarray:
    """Return (X, Y, 1) bool, corridors one cell wide, one path between any two cells (a depth-first maze)."""
    rng, covered = np.random.default_rng(seed), np.ones(shape, bool)
    size, at = ((shape[0] - 1) // 2, (shape[1] - 1) // 2), (0, 0)
    path, seen = [at], np.zeros(size, bool)
    seen[at] = True
    covered[1, 1] = False
    while path:
        x, y = path[-1]
        around = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        fresh = [n for n in around if 0 <= n[0] < size[0] and 0 <= n[1] < size[1] and not seen[n]]
        if not fresh:
            path.pop()
            continue
        i, j = fresh[int(rng.integers(len(fresh)))]
        seen[i, j] = True
        covered[2 * i + 1, 2 * j + 1] = covered[x + i + 1, y + j + 1] = False
        path.append((i, j))
    return covered


def noise(shape: tuple[int, int, int], seed: int = 0) -> np.ndarray:
    """Return (X, Y, 1) float32, traversal costs drawn from 0.05 to 1 for each voxel by itself."""
    return np.random.default_rng(seed).uniform(0.05, 1.0, shape).astype(np.float32)


def traversal_costs(covered: np.ndarray) -> np.ndarray:
    """Return (X, Y, 1) float32, 1 where it is free, inf elsewhere."""
    return np.where(covered, np.inf, 1.0).astype(np.float32)


def voronoi_rows(effort: Effort) -> list[Row]:
    """Return rows of Voronoi cells of four sources beside SciPy."""
    rooms = RECIPES["bhattacharya-cluttered"](MAP, np.random.default_rng(0)).occupied
    maps = {
        "rooms": traversal_costs(rooms),
        "a maze": traversal_costs(maze(MAP.shape)),
        "white-noise costs": noise(MAP.shape),
    }
    return [voronoi_row(name, costs, effort) for name, costs in maps.items()]


def voronoi_row(name: str, costs: np.ndarray, effort: Effort) -> Row:
    """Return maps a second with the cells of SOURCES sources; SciPy gives the costs, and no cells."""
    free, shape = np.flatnonzero(np.isfinite(costs)), costs.shape
    sources = np.random.default_rng(1).choice(free, SOURCES, replace=False).astype(np.int32)
    seconds = beside_scipy(costs, sources, effort.long_rounds)
    job = f"geodesic Voronoi cells, {shape[0]} × {shape[1]}, {SOURCES} sources, {name}"
    ours, theirs = ([1.0 / each_s for each_s in side] for side in seconds)
    return compared(job, "SciPy dijkstra, min_only", ours, theirs, "maps/s", Goal("≥", 4.5))
