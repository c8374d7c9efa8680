"""Geodesic Voronoi cells beside SciPy's Dijkstra, in plans of Bhattacharya and in costs that are noise.

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


def voronoi_rows(effort: Effort, grid: Grid = MAP) -> list[Row]:
    """Return maps a second with the cells of four sources; SciPy gives the costs, and no cells."""
    rows, rng = [], np.random.default_rng(0)
    for name in ("office", "cluttered", "white noise"):
        costs = rng.uniform(0.05, 1.0, grid.shape).astype(np.float32)
        if name != "white noise":
            costs[...] = np.where(RECIPES[f"bhattacharya-{name}"](grid, rng).occupied, np.inf, 1.0)
        sources = rng.choice(np.flatnonzero(np.isfinite(costs)), 4, replace=False).astype(np.int32)
        job = f"geodesic Voronoi cells, {name}, {grid.shape[0]} × {grid.shape[1]}, 4 sources"
        seconds = beside_scipy(costs, sources, effort.long_rounds)
        ours, theirs = ([1.0 / each_s for each_s in side] for side in seconds)
        rows.append(compared(job, "SciPy dijkstra, min_only", ours, theirs, "maps/s", Goal("≥", 4.5)))
    return rows
