"""The rows of shortest ways are measured, and both sides find the same costs."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse.csgraph import dijkstra

from benchmarks.planning import Search, cluttered, crossing_row, step_graph, voronoi_row
from benchmarks.rows import Effort

TINY = Effort(rounds=2, long_rounds=1)


def test_both_sides_have_the_same_steps():
    covered = cluttered((70, 53, 1), 0.2)
    free = np.flatnonzero(~covered)
    ours = Search(covered)
    expected = dijkstra(step_graph(covered), indices=int(free[0]))
    for goal in free[:: len(free) // 7]:
        cost = ours.cost(int(free[0]), int(goal))
        assert cost == expected[goal] or math.isclose(cost, expected[goal], rel_tol=1e-8)
    assert np.isfinite(expected[free]).mean() > 0.5


def test_rows_are_measured():
    voronoi = voronoi_row((90, 61, 1), TINY)
    assert voronoi.unit == "maps/s" and voronoi.goal == "≥ 4.5 ×" and voronoi.ours > 0 and voronoi.theirs
    crossing = crossing_row((201, 103, 1), TINY)
    assert crossing.unit == "ms" and crossing.goal == "< 50 ms" and crossing.ours > 0
