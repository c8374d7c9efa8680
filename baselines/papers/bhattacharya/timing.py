"""Tessellations beside SciPy's Dijkstra, which gets its graph ready-made; what one leaves for the next."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from baselines.papers.bhattacharya.simulation.team import Simulation
from entropy_explore_env.belief.paths.geodesic_cells import UNREACHED, new_tessellation, tessellate


def cost_graph(costs_per_cell: np.ndarray, length_cost: float = 0.0, by_length: bool = True) -> csr_matrix:
    """(V, V) what steps between the cells of a plan cost, as `tessellate` has it; none past a corner.

    Args:
        costs_per_cell: (X, Y, 1) float32, traversal cost of a cell; inf = impassable.
        length_cost: Cost of a voxel edge of path in addition.
        by_length: Whether diagonal steps pay the costs_per_cell of their whole length.
    """
    size_x, size_y, _ = costs_per_cell.shape
    plane, numbers = (
        costs_per_cell[:, :, 0].astype(np.float64),
        np.arange(costs_per_cell.size).reshape(size_x, size_y),
    )
    free, rows, columns, costs = np.isfinite(plane), [], [], []

    def moved(field: np.ndarray, x: int, y: int, by: tuple[int, int]) -> np.ndarray:
        """What lies `by` beside the cells from which a step (x, y) stays inside."""
        low_x, low_y = max(-x, 0) + by[0], max(-y, 0) + by[1]
        return field[low_x : low_x + size_x - abs(x), low_y : low_y + size_y - abs(y)]

    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        passed = [(0, 0), (x, y), (x, 0), (0, y)]
        legal, length = np.logical_and.reduce([moved(free, x, y, by) for by in passed]), math.hypot(x, y)
        mean = 0.5 * (moved(plane, x, y, (0, 0))[legal] + moved(plane, x, y, (x, y))[legal])
        rows.append(moved(numbers, x, y, (0, 0))[legal])
        columns.append(moved(numbers, x, y, (x, y))[legal])
        costs.append(mean * (length if by_length else 1.0) + length_cost * length)
    ends = (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix((np.concatenate(costs), ends), shape=(costs_per_cell.size, costs_per_cell.size))


class Seconds(NamedTuple):
    """Seconds of processor time of a tessellation; SciPy's without the owners of cells."""

    ours: float
    scipy: float


def beside_scipy(costs_per_cell: np.ndarray, sources: np.ndarray, rounds: int = 5) -> Seconds:
    """Seconds of processor time of a tessellation, ours and SciPy's (`min_only`, costs alone); medians.

    Raises:
        RuntimeError: The costs differ.
    """
    graph, space = cost_graph(costs_per_cell), new_tessellation(costs_per_cell.shape)
    tessellate(space, costs_per_cell, sources)
    if not np.allclose(space.costs.ravel(), dijkstra(graph, indices=sources, min_only=True), rtol=1e-6):
        raise RuntimeError("our costs are not SciPy's")
    ours, theirs = [], []
    for _ in range(rounds):
        ours.append(_timed(lambda: tessellate(space, costs_per_cell, sources)))
        theirs.append(_timed(lambda: dijkstra(graph, indices=sources, min_only=True)))
    return Seconds(statistics.median(ours), statistics.median(theirs))


def changed_share(simulation: Simulation, iterations: int) -> float:
    """Share of cells in reach whose cost or owner is another one than at the tessellation before; mean.

    A search that starts from the last tessellation has to visit all of them.

    Args:
        simulation: With perfect messages; goes on from where it is.
        iterations: How many.
    """
    space, shares = simulation.planners[0].space, list[float]()
    costs, cells = space.costs.copy(), space.cells.copy()
    for _ in range(iterations):
        before = simulation.planners[0].tessellations
        simulation.step(functional=False)
        if simulation.planners[0].tessellations > before:
            changed = (space.costs != costs) | (space.cells != cells)
            shares.append(float(changed[space.cells != UNREACHED].mean()))
            costs, cells = space.costs.copy(), space.cells.copy()
    return statistics.fmean(shares[1:]) if len(shares) > 1 else math.nan


def _timed(work: Callable[[], object]) -> float:
    before = time.thread_time()
    work()
    return time.thread_time() - before
