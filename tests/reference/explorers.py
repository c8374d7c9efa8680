"""Textbook rules of exploration in plain Python, NumPy and SciPy, slow: frontiers, path lengths, choices.

Point robots in plans. A map is (X, Y) int8: UNKNOWN, FREE or WALL. Paths lead from cell centre to cell centre
through known free cells; a diagonal step needs both cells beside it.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

UNKNOWN, FREE, WALL = -1, 0, 1
Cell = tuple[int, int]


def frontier_cells(plan: np.ndarray) -> list[Cell]:
    """Known free cells that share a side with an unknown one (Yamauchi 1998)."""
    found = []
    for x, y in zip(*np.nonzero(plan == FREE), strict=True):
        beside = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        inside = [(i, j) for i, j in beside if 0 <= i < plan.shape[0] and 0 <= j < plan.shape[1]]
        if any(plan[place] == UNKNOWN for place in inside):
            found.append((int(x), int(y)))
    return found


def steps(plan: np.ndarray) -> csr_array:
    """(X·Y, X·Y) lengths of the steps between neighbouring known free cells."""
    rows, columns, lengths = [], [], []
    for x, y in zip(*np.nonzero(plan == FREE), strict=True):
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            i, j = x + dx, y + dy
            if not (0 <= i < plan.shape[0] and 0 <= j < plan.shape[1]) or plan[i, j] != FREE:
                continue
            if dx and dy and (plan[i, y] != FREE or plan[x, j] != FREE):
                continue
            rows.append(x * plan.shape[1] + y)
            columns.append(i * plan.shape[1] + j)
            lengths.append(math.hypot(dx, dy))
    cells = plan.size
    return csr_array((lengths, (rows, columns)), shape=(cells, cells))


def lengths_from(plan: np.ndarray, cell: Cell) -> np.ndarray:
    """(X, Y) lengths of the shortest paths from a cell; inf = there is none."""
    number = cell[0] * plan.shape[1] + cell[1]
    return np.asarray(dijkstra(steps(plan), directed=False, indices=number)).reshape(plan.shape)


def nearest_frontier(plan: np.ndarray, robot: Cell) -> dict[Cell, float]:
    """Frontier cell → minus the length of the path to it."""
    lengths = lengths_from(plan, robot)
    return {cell: -lengths[cell] for cell in frontier_cells(plan) if math.isfinite(lengths[cell])}


def distance_advantage(plan: np.ndarray, robot: Cell, radius: int, horizon: float) -> dict[Cell, float]:
    """Frontier cell within the horizon → its distance advantage; if there is none, as `nearest_frontier`.

    The free cells u are those that the robot can reach, at most `radius` off along either axis.
    """
    lengths = lengths_from(plan, robot)
    near = [cell for cell in frontier_cells(plan) if lengths[cell] <= horizon and lengths[cell] < math.inf]
    if not near:
        return nearest_frontier(plan, robot)
    x, y = np.indices(plan.shape)
    around = (abs(x - robot[0]) <= radius) & (abs(y - robot[1]) <= radius) & np.isfinite(lengths)
    return {cell: float(lengths_from(plan, cell)[around].mean() - lengths[cell]) for cell in near}


def chosen(values: dict[Cell, float]) -> Cell | None:
    """A cell of greatest value."""
    return max(values, key=values.__getitem__) if values else None


def coordinated(
    plan: np.ndarray, robots: list[Cell], targets: list[Cell], beta: float, reach: float
) -> list[Cell | None]:
    """Burgard 2005's algorithm: who of several robots that choose together goes to which frontier cell.

    Args:
        plan: The map that all of them have.
        robots: Where they are.
        targets: Where others are under way to.
        beta: Cost of a path as long as the reach.
        reach: The sensor's range, in cells.
    """
    cells = frontier_cells(plan)
    utility = {cell: 1.0 - sum(max(1.0 - math.dist(cell, t) / reach, 0.0) for t in targets) for cell in cells}
    lengths = [lengths_from(plan, robot) for robot in robots]
    found: list[Cell | None] = [None] * len(robots)
    for _ in robots:
        worth = {
            (robot, cell): utility[cell] - beta * lengths[robot][cell] / reach
            for robot in range(len(robots))
            if found[robot] is None
            for cell in cells
            if math.isfinite(lengths[robot][cell])
        }
        if not worth:
            break
        robot, cell = max(worth, key=worth.__getitem__)
        found[robot] = cell
        for other in cells:
            utility[other] -= max(1.0 - math.dist(other, cell) / reach, 0.0)
    return found
