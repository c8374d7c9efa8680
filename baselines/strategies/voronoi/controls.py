"""Controls of Voronoi coverage: where in its geodesic cell a robot goes (Bhattacharya, Michael & Kumar 2010).

Costs are those of the tessellation that the cells come from (belief/paths/geodesic_cells.py); densities φ
have no unit. Voxels are numbered in C order; of equals the first by number is taken.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.paths.geodesic_cells import UNREACHED, Tessellation, tessellate
from entropy_explore_env.compilation.kernels import lean_kernel


def projected_centroids(
    cells: np.ndarray, density: np.ndarray, threshold: float, sources: int
) -> tuple[np.ndarray, np.ndarray]:
    """The centroid of each cell, projected into it (eqs. 6-8).

        C = Σ q φ(q) / Σ φ(q)   over the cell;   the target is the q nearest to C, of those with φ(q) ≥ τ if
        there are any, else of all voxels of the cell.

    Args:
        cells: (X, Y, Z) int32, the cell of each voxel; UNREACHED = none.
        density: (X, Y, Z) float32, φ > 0.
        threshold: τ.
        sources: How many cells S there are.

    Returns:
        (S,) int64 targets, UNREACHED for an empty cell, and (S,) int64, how many voxels have φ ≥ τ.
    """
    sums, nearest = np.zeros((sources, 4)), np.full((sources, 2), np.inf)
    targets = np.full((sources, 2), UNREACHED, np.int64)
    uncertain = np.zeros(sources, np.int64)
    _sum_moments(cells, density, threshold, sums, uncertain)
    _project(cells, density, threshold, sums, nearest, targets)
    return np.where(targets[:, 0] == UNREACHED, targets[:, 1], targets[:, 0]), uncertain


@lean_kernel
def step_is_free(coverage: np.ndarray, size: tuple[int, int, int], here: int, there: int) -> bool:
    """Whether one step leads from a voxel to another without cutting a covered corner.

    Args:
        coverage: (V,) float32, above ½ = covered.
        size: (X, Y, Z) voxels.
        here: Number of a voxel; may be covered.
        there: Likewise.
    """
    column, other = here // size[2], there // size[2]
    x, y, z = column // size[1], column % size[1], here % size[2]
    i, j, k = other // size[1], other % size[1], there % size[2]
    if abs(i - x) > 1 or abs(j - y) > 1 or abs(k - z) > 1:
        return False
    for a in range(min(x, i), max(x, i) + 1):
        for b in range(min(y, j), max(y, j) + 1):
            for c in range(min(z, k), max(z, k) + 1):
                voxel = (a * size[1] + b) * size[2] + c
                if voxel != here and coverage[voxel] > 0.5:
                    return False
    return True


@lean_kernel
def _sum_moments(
    cells: np.ndarray, density: np.ndarray, threshold: float, sums: np.ndarray, uncertain: np.ndarray
) -> None:
    """Add up φ, xφ, yφ and zφ of each cell, and count where φ ≥ τ."""
    for x in range(cells.shape[0]):
        for y in range(cells.shape[1]):
            for z in range(cells.shape[2]):
                cell = cells[x, y, z]
                if cell >= 0:
                    weight = np.float64(density[x, y, z])
                    sums[cell, 0] += weight
                    sums[cell, 1] += weight * x
                    sums[cell, 2] += weight * y
                    sums[cell, 3] += weight * z
                    uncertain[cell] += weight >= threshold


@lean_kernel
def _project(
    cells: np.ndarray,
    density: np.ndarray,
    threshold: float,
    sums: np.ndarray,
    nearest: np.ndarray,
    targets: np.ndarray,
) -> None:
    """Fill (S, 2) with the voxels nearest to the centroids: of those with φ ≥ τ, and of the others."""
    voxel = 0
    for x in range(cells.shape[0]):
        for y in range(cells.shape[1]):
            for z in range(cells.shape[2]):
                cell = cells[x, y, z]
                if cell >= 0:
                    total, kind = sums[cell, 0], 0 if density[x, y, z] >= threshold else 1
                    away_x, away_y = x - sums[cell, 1] / total, y - sums[cell, 2] / total
                    away_z = z - sums[cell, 3] / total
                    away = away_x * away_x + away_y * away_y + away_z * away_z
                    if away < nearest[cell, kind]:
                        nearest[cell, kind], targets[cell, kind] = away, voxel
                voxel += 1


def nearest_uncertain(
    cells: np.ndarray, costs: np.ndarray, density: np.ndarray, threshold: float, sources: int
) -> np.ndarray:
    """(S,) int64: of each cell the voxel with φ ≥ τ that costs least to reach; UNREACHED = it has none."""
    cheapest, targets = np.full(sources, np.inf), np.full(sources, UNREACHED, np.int64)
    _find_nearest_uncertain(cells, costs, density, threshold, cheapest, targets)
    return targets


@lean_kernel
def _find_nearest_uncertain(
    cells: np.ndarray,
    costs: np.ndarray,
    density: np.ndarray,
    threshold: float,
    cheapest: np.ndarray,
    targets: np.ndarray,
) -> None:
    voxel = 0
    for x in range(cells.shape[0]):
        for y in range(cells.shape[1]):
            for z in range(cells.shape[2]):
                cell = cells[x, y, z]
                if cell >= 0 and density[x, y, z] >= threshold and costs[x, y, z] < cheapest[cell]:
                    cheapest[cell], targets[cell] = costs[x, y, z], voxel
                voxel += 1


def coverage_functionals(
    cells: np.ndarray, costs: np.ndarray, density: np.ndarray, sources: int
) -> np.ndarray:
    """(S,) float64, the coverage functional of each cell, H = Σ d(q, p)² φ(q) (sect. 3, f(x) = x²)."""
    functionals = np.zeros(sources)
    _add_functionals(cells, costs, density, functionals)
    return functionals


@lean_kernel
def _add_functionals(
    cells: np.ndarray, costs: np.ndarray, density: np.ndarray, functionals: np.ndarray
) -> None:
    for x in range(cells.shape[0]):
        for y in range(cells.shape[1]):
            for z in range(cells.shape[2]):
                cell = cells[x, y, z]
                if cell >= 0:
                    cost = costs[x, y, z]
                    functionals[cell] += cost * cost * np.float64(density[x, y, z])


class CellFunctional:
    """The coverage functional of one robot's cell, for any place of the robot in it (eq. 3)."""

    def __init__(
        self, space: Tessellation, traversal_cost: np.ndarray, density: np.ndarray, cell: np.ndarray
    ) -> None:
        """Consider the cell alone: paths do not leave it.

        Args:
            space: Memory for tessellations; overwritten.
            traversal_cost: (X, Y, Z) float32, as the tessellation had it.
            density: (X, Y, Z) float32, φ.
            cell: (X, Y, Z) bool, the cell.
        """
        self._space, self._density, self._cell = space, density, cell
        self._traversal_cost = np.where(cell, traversal_cost, np.float32(np.inf))

    def value(self, voxel: int, length_cost: float, by_length: bool) -> float:
        """H of the cell for a robot in this voxel; inf if a part of the cell cannot be reached from there."""
        tessellate(self._space, self._traversal_cost, np.array([voxel]), length_cost, by_length)
        reached = np.count_nonzero(self._space.cell == 0)
        if reached < np.count_nonzero(np.isfinite(self._traversal_cost)):
            return math.inf
        return float(coverage_functionals(self._space.cells, self._space.costs, self._density, 1)[0])

    def descent(self, voxel: int, most: int, length_cost: float, by_length: bool) -> list[int]:
        """Return the voxels of at most `most` steps of `gradient_step`, each from the one before."""
        path = list[int]()
        for _ in range(most):
            step = gradient_step(self, self._cell, voxel, length_cost, by_length)
            if step == voxel:
                break
            path.append(step)
            voxel = step
        return path


def neighbours(free: np.ndarray, voxel: int) -> list[int]:
    """Voxels to which one step leads without cutting a corner: up to 8, or 26; in the order of numbers.

    Args:
        free: (X, Y, Z) bool.
        voxel: Where the step begins.
    """
    place, size = np.unravel_index(voxel, free.shape), free.shape
    found = []
    for step in np.ndindex(3, 3, 3):
        there = [int(at) + along - 1 for at, along in zip(place, step, strict=True)]
        if there != list(place) and all(0 <= i < n for i, n in zip(there, size, strict=True)):
            spans = [slice(min(at, to), max(at, to) + 1) for at, to in zip(place, there, strict=True)]
            if free[tuple(spans)].all():
                found.append(int(np.ravel_multi_index(there, size)))
    return found


def gradient_step(
    functional: CellFunctional, cell: np.ndarray, voxel: int, length_cost: float, by_length: bool
) -> int:
    """The neighbour in its own cell at which the robot's functional is least; itself if none is less (eq. 3).

    Args:
        functional: Of the robot's cell.
        cell: (X, Y, Z) bool, the cell.
        voxel: Where the robot is.
        length_cost: As the tessellation had it.
        by_length: Likewise.
    """
    best, least = voxel, functional.value(voxel, length_cost, by_length)
    for near in neighbours(cell, voxel):
        value = functional.value(near, length_cost, by_length)
        if value < least:
            best, least = near, value
    return best
