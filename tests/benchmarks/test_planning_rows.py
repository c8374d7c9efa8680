"""Rows of Voronoi cells are measured, and both sides find the same costs."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.papers.bhattacharya.measured import check_tessellation, cost_graph
from benchmarks.planning import voronoi_rows
from benchmarks.rows import Effort
from entropy_explore_env.belief.paths.geodesic_cells import new_tessellation, tessellate
from entropy_explore_env.settings.grid import Grid


def test_the_rows_are_measured():
    rows = voronoi_rows(Effort(rounds=2, long_rounds=1), Grid((300, 240, 1), 0.1))
    assert len(rows) == 3
    for row in rows:
        assert row.unit == "maps/s" and row.goal == "≥ 4.5 ×" and row.ours > 0 and row.theirs


def test_wrong_costs_and_cells_are_found():
    rates = np.random.default_rng(0).uniform(0.05, 1.0, (40, 31, 1)).astype(np.float32)
    ours, graph, sources = new_tessellation((40, 31, 1)), cost_graph(rates), np.array([5, 900])
    tessellate(ours, rates, sources)
    check_tessellation(ours, graph, sources)
    ours.cells[3, 3] ^= 1
    with pytest.raises(RuntimeError, match="cells"):
        check_tessellation(ours, graph, sources)
    ours.costs[3, 3] *= 2.0
    with pytest.raises(RuntimeError, match="costs"):
        check_tessellation(ours, graph, sources)
