"""Geodesic Voronoi cells beside SciPy's Dijkstra, in the largest plan of Bhattacharya.

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
SOURCES = 4


def voronoi_rows(effort: Effort, grid: Grid = MAP) -> list[Row]:
    """Return maps a second with the cells of SOURCES sources; SciPy gives the costs, and no cells."""
    occupied = RECIPES["bhattacharya-cluttered"](grid, np.random.default_rng(0)).occupied
    free = np.flatnonzero(~occupied)
    sources = np.random.default_rng(1).choice(free, SOURCES, replace=False).astype(np.int32)
    costs = np.where(occupied, np.inf, 1.0).astype(np.float32)
    seconds = beside_scipy(costs, sources, effort.long_rounds)
    job = f"geodesic Voronoi cells, {grid.shape[0]} × {grid.shape[1]}, {SOURCES} sources"
    ours, theirs = ([1.0 / each_s for each_s in side] for side in seconds)
    return [compared(job, "SciPy dijkstra, min_only", ours, theirs, "maps/s", Goal("≥", 4.5))]
