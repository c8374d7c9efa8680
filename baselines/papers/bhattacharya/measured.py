"""Fig. 4 of Bhattacharya, and tessellations beside SciPy's Dijkstra on the clock.

In fig. 4 an unknown region lies nearer to one of two robots; measured is the share that each robot gets.
SciPy gets its graph ready-made.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from baselines.experiments.rows import Record
from baselines.papers.bhattacharya.run import Run, start_cells
from entropy_explore_env.belief.entropy import LN2
from entropy_explore_env.belief.paths.geodesic_cells import (
    UNREACHED,
    Tessellation,
    new_tessellation,
    tessellate,
)

SHAPE = (200, 121, 1)
ETAS = (1e-4, 1e-3, 1e-2, 3e-2, 1e-1, 1.0)
REGIONS = ("band", "patch")
"""A band from wall to wall, which separates the robots; a patch with free space around it."""
ROBOTS = ((20, 60), (180, 60))
"""Cells of the robots."""
_BAND = (90, 170)
"""Nearer to the second robot."""


class Split(NamedTuple):
    """The robot nearest to each cell, and the first robot's unexplored area over the second's."""

    cells: np.ndarray
    """(X, Y) int32."""
    ratio: float


def unknown_region(name: str) -> np.ndarray:
    """Return (X, Y, 1) bool, the region."""
    region = np.zeros(SHAPE, bool)
    rows = slice(None) if name == "band" else slice(35, 86)
    region[_BAND[0] : _BAND[1], rows] = True
    return region


def split(name: str, eta: float | None) -> Split:
    """Tessellate a convex plan with a region: into entropy-weighted cells for an η, else into plain ones."""
    region, space = unknown_region(name), new_tessellation(SHAPE)
    sources = np.array([x * SHAPE[1] + y for x, y in ROBOTS])
    if eta is None:
        tessellate(space, np.ones(SHAPE, np.float32), sources)
    else:
        tessellate(space, np.where(region, LN2, 0.0).astype(np.float32), sources, eta, by_length=False)
    areas = [int(np.count_nonzero((space.cells == robot) & region)) for robot in range(2)]
    return Split(space.cells[:, :, 0].copy(), areas[0] / max(areas[1], 1))


def ratios() -> dict[str, Any]:
    """Return the ratio by region, of plain cells and for each η."""
    return {
        name: {"plain": split(name, None).ratio, **{f"{eta:g}": split(name, eta).ratio for eta in ETAS}}
        for name in REGIONS
    }


def cost_graph(costs_per_cell: np.ndarray) -> csr_matrix:
    """Return (V, V) what steps between the cells of a plan cost, as `tessellate` has it; none past a corner.

    Args:
        costs_per_cell: (X, Y, 1) float32, traversal cost of a cell; inf = impassable.
    """
    size_x, size_y, _ = costs_per_cell.shape
    plane = costs_per_cell[:, :, 0].astype(np.float64)
    numbers = np.arange(costs_per_cell.size).reshape(size_x, size_y)
    free, rows, columns, costs = np.isfinite(plane), [], [], []

    def moved(field: np.ndarray, x: int, y: int, by: tuple[int, int]) -> np.ndarray:
        """Return what lies `by` beside the cells from which a step (x, y) stays inside."""
        low_x, low_y = max(-x, 0) + by[0], max(-y, 0) + by[1]
        return field[low_x : low_x + size_x - abs(x), low_y : low_y + size_y - abs(y)]

    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        passed = [(0, 0), (x, y), (x, 0), (0, y)]
        legal, length = np.logical_and.reduce([moved(free, x, y, by) for by in passed]), math.hypot(x, y)
        mean = 0.5 * (moved(plane, x, y, (0, 0))[legal] + moved(plane, x, y, (x, y))[legal])
        rows.append(moved(numbers, x, y, (0, 0))[legal])
        columns.append(moved(numbers, x, y, (x, y))[legal])
        costs.append(mean * length)
    ends = (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix((np.concatenate(costs), ends), shape=(costs_per_cell.size, costs_per_cell.size))


class Seconds(NamedTuple):
    """Seconds of processor time of a tessellation in each round; SciPy's without the owners of cells."""

    ours: list[float]
    scipy: list[float]


def beside_scipy(costs_per_cell: np.ndarray, sources: np.ndarray, rounds: int = 5) -> Seconds:
    """Time a tessellation, ours and SciPy's (`min_only`, costs alone), in turns.

    Raises:
        RuntimeError: Costs or cells differ.
    """
    graph, space = cost_graph(costs_per_cell), new_tessellation(costs_per_cell.shape)
    tessellate(space, costs_per_cell, sources)
    check_tessellation(space, graph, sources)
    seconds = Seconds([], [])
    for _ in range(rounds):
        seconds.ours.append(_timed(lambda: tessellate(space, costs_per_cell, sources)))
        seconds.scipy.append(_timed(lambda: dijkstra(graph, indices=sources, min_only=True)))
    return seconds


def check_tessellation(ours: Tessellation, graph: csr_matrix, sources: np.ndarray) -> None:
    """Raise a RuntimeError unless costs and cells are those of a Dijkstra from each source by itself."""
    each = dijkstra(graph, indices=sources)
    costs, cells, least = ours.costs.ravel(), ours.cells.ravel(), each.min(axis=0)
    if not np.allclose(costs, least, rtol=1e-6):
        raise RuntimeError("our costs are not SciPy's")
    reached = np.flatnonzero(np.isfinite(least))
    if (cells[~np.isfinite(least)] != UNREACHED).any():
        raise RuntimeError("a voxel that no source reaches has a cell")
    first = (each[:, reached] <= least[reached] * (1.0 + 1e-9)).argmax(axis=0)
    if not np.array_equal(cells[reached], first):
        raise RuntimeError("our cells are not those of the first nearest source")


def _timed(work: Callable[[], object]) -> float:
    before = time.thread_time()
    work()
    return time.thread_time() - before


@dataclass(frozen=True)
class Measured:
    """What is measured beside the runs: (c), and a tessellation of the largest plan on the clock.

    Attributes:
        largest: A run in that plan.
    """

    largest: Run
    cell: str = "measured"
    seed: int = 0
    world: str = "bhattacharya-cluttered"

    @property
    def settings(self) -> dict[str, Any]:
        """The run."""
        return {"largest": self.largest.settings}

    def run(self) -> Record:
        """Measure the splits and the time of a tessellation.

        Returns:
            `splits`, ratios of (c) by region; `ours_s` and `scipy_s` of a tessellation.
        """
        plan = self.largest.plan()
        costs = np.where(plan, np.inf, 1.0).astype(np.float32)
        seconds = beside_scipy(costs, np.array(start_cells(plan, "random", 4, 0)))
        ours_s, scipy_s = map(statistics.median, seconds)
        return {"splits": ratios(), "ours_s": ours_s, "scipy_s": scipy_s}
