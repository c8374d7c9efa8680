"""The rows of Voronoi cells are measured, and both sides find the same costs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from baselines.papers.bhattacharya.measured import check_tessellation, cost_graph
from benchmarks.planning import (
    maze,
    noise,
    traversal_costs,
    voronoi_row,
)
from benchmarks.rows import Effort
from entropy_explore_env.belief.paths.geodesic_cells import new_tessellation, tessellate

TINY = Effort(rounds=2, long_rounds=1)


def test_rows_are_measured():
    shape = (90, 61, 1)
    for name, rates in (
        ("a maze", traversal_costs(maze(shape))),
        ("noise", noise(shape)),
    ):
        voronoi = voronoi_row(name, rates, TINY)
        assert voronoi.unit == "maps/s" and voronoi.goal == "≥ 4.5 ×" and voronoi.ours > 0 and voronoi.theirs
        assert name in voronoi.job


def test_all_of_a_maze_is_connected():
    covered = maze((91, 61, 1))
    free = np.flatnonzero(~covered)
    reached = np.isfinite(dijkstra(cost_graph(traversal_costs(covered)), indices=int(free[0])))
    assert reached[free].all() and 0.2 < covered.mean() < 0.8


def test_wrong_costs_and_cells_are_found():
    rates, sources = noise((40, 31, 1)), np.array([5, 900])
    ours, graph = new_tessellation((40, 31, 1)), cost_graph(rates)
    tessellate(ours, rates, sources)
    check_tessellation(ours, graph, sources)
    ours.cells[3, 3] ^= 1
    with pytest.raises(RuntimeError, match="cells"):
        check_tessellation(ours, graph, sources)
    ours.costs[3, 3] *= 2.0
    with pytest.raises(RuntimeError, match="costs"):
        check_tessellation(ours, graph, sources)
