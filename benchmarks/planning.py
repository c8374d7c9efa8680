"""Shortest ways: geodesic Voronoi cells beside SciPy's Dijkstra, and plans across a large floor.

Both sides get the same steps at the same costs. SciPy's graph is made before the clock starts; ours
is the field of rates, or the belief, itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from benchmarks.rows import Effort, Goal, Row, alone, compared, interleave, timed
from entropy_explore_env.belief.geodesic_cells import new_tessellation, tessellate
from entropy_explore_env.belief.lattice import belief_costs, new_lattice
from entropy_explore_env.belief.planning import search_ways
from entropy_explore_env.belief.search_space import new_search

MAP = (1000, 783, 1)
"""The cluttered map of Bhattacharya, 1000 × 783."""
FLOOR = (1674, 1006, 1)
"""As many cells as the nav2 project's warehouse, of which 16 % are covered."""
SOURCES = 4
_MAP_SHARE, _FLOOR_SHARE = 0.25, 0.16
_EDGES = (4, 40)
_PRIOR, _KNOWN = 1e-3, 100.0
_NO_CELLS = np.zeros(0, np.int32)


def cluttered(shape: tuple[int, int, int], share: float, seed: int = 0) -> np.ndarray:
    """(X, Y, 1) bool, boxes of 4-39 cells over this share of the floor."""
    rng, covered = np.random.default_rng(seed), np.zeros(shape, bool)
    while covered.mean() < share:
        x, y = rng.integers(0, shape[:2])
        wide, deep = rng.integers(*_EDGES, 2)
        covered[x : x + wide, y : y + deep] = True
    return covered


def step_graph(covered: np.ndarray) -> csr_matrix:
    """(V, V) steps between the free voxels of a 2-D world; none past a covered corner."""
    size_x, size_y, _ = covered.shape
    free, numbers = ~covered[:, :, 0], np.arange(covered.size).reshape(size_x, size_y)
    rows, columns, lengths = [], [], []

    def moved(field: np.ndarray, x: int, y: int, by: tuple[int, int]) -> np.ndarray:
        """What lies `by` beside the voxels from which a step (x, y) stays inside."""
        low_x, low_y = max(-x, 0) + by[0], max(-y, 0) + by[1]
        return field[low_x : low_x + size_x - abs(x), low_y : low_y + size_y - abs(y)]

    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        passed = [(0, 0), (x, y), (x, 0), (0, y)]
        legal = np.logical_and.reduce([moved(free, x, y, by) for by in passed])
        rows.append(moved(numbers, x, y, (0, 0))[legal])
        columns.append(moved(numbers, x, y, (x, y))[legal])
        lengths.append(np.full(len(rows[-1]), math.hypot(x, y)))
    ends = (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix((np.concatenate(lengths), ends), shape=(covered.size, covered.size))


@dataclass(frozen=True)
class Search:
    """Our side: a search on a belief that is sure of everything."""

    covered: np.ndarray
    body_radius: float = 0.0

    def __post_init__(self) -> None:
        """Make room."""
        belief = self.covered.astype(np.float32), np.full(self.covered.shape, _KNOWN, np.float32)
        lattice = new_lattice(self.covered.shape, self.body_radius)
        parts = new_search(self.covered.size), lattice, belief_costs(*belief, _PRIOR)
        object.__setattr__(self, "_parts", parts)

    def cost(self, start: int, goal: int) -> float:
        """Cost of a way."""
        sources = np.array([start], np.int32)
        return search_ways(*self._parts, sources, goal, math.inf, _NO_CELLS)  # type: ignore[attr-defined]


def planning_rows(effort: Effort) -> list[Row]:
    """Voronoi cells of four sources beside SciPy, and a plan across a floor."""
    return [voronoi_row(MAP, effort), crossing_row(FLOOR, effort)]


def voronoi_row(shape: tuple[int, int, int], effort: Effort) -> Row:
    """Maps a second with the cells of SOURCES sources; SciPy gives the costs, and no cells."""
    covered = cluttered(shape, _MAP_SHARE)
    free = np.flatnonzero(~covered)
    sources = np.random.default_rng(1).choice(free, SOURCES, replace=False).astype(np.int32)
    graph, ours = step_graph(covered), new_tessellation(shape)
    rates = np.where(covered, np.inf, 1.0).astype(np.float32)
    tessellate(ours, rates, sources)
    theirs = dijkstra(graph, indices=sources, min_only=True)
    if not np.allclose(ours.costs.ravel(), theirs, rtol=1e-6):
        raise RuntimeError("our costs are not SciPy's")
    taken = interleave(
        {
            "ours": lambda _: timed(lambda: tessellate(ours, rates, sources)),
            "scipy": lambda _: timed(lambda: dijkstra(graph, indices=sources, min_only=True)),
        },
        effort.long_rounds,
    )
    return compared(
        f"geodesic Voronoi cells, {shape[0]} × {shape[1]}, {SOURCES} sources",
        "SciPy dijkstra, min_only",
        [1.0 / t.cpu_s for t in taken["ours"]],
        [1.0 / t.cpu_s for t in taken["scipy"]],
        "maps/s",
        Goal("≥", 4.5),
    )


def crossing_row(shape: tuple[int, int, int], effort: Effort) -> Row:
    """Milliseconds of a plan from corner to corner, for a body of 2½ cells."""
    covered = cluttered(shape, _FLOOR_SHARE)
    corner = 12
    covered[:corner, :corner] = covered[-corner:, -corner:] = False
    ours, place = Search(covered, 2.5), corner // 2
    ends = place * shape[1] + place, (shape[0] - place) * shape[1] - place
    if math.isinf(ours.cost(*ends)):
        raise RuntimeError("there is no way across the floor")
    taken = [timed(lambda: ours.cost(*ends)).cpu_s for _ in range(effort.rounds)]
    job = f"plan across {shape[0]} × {shape[1]}, {_FLOOR_SHARE:.0%} covered, body of 2.5 cells"
    return alone(job, [1e3 * cpu_s for cpu_s in taken], "ms", Goal("<", 50.0, "ms"))
