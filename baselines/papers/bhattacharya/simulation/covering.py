"""Steps in a cell, and the coverage functional of eq. 3 that they lower (Bhattacharya, Michael & Kumar 2010).

Density φ is (X, Y, Z) float32 > 0, without a unit. Costs are (X, Y, Z) float64, those of a tessellation
(belief/paths/geodesic_cells.py).
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.paths.geodesic_cells import Tessellation, tessellate
from entropy_explore_env.compilation.kernels import lean_kernel


def step_is_free(free: np.ndarray, here: int, there: int) -> bool:
    """Return whether one step leads from a voxel to another without cutting a corner.

    Args:
        free: (X, Y, Z) bool.
        here: Where the step begins; it counts as free.
        there: Another voxel.
    """
    place, target = (np.unravel_index(voxel, free.shape) for voxel in (here, there))
    low, high = np.minimum(place, target), np.maximum(place, target)
    box = free[low[0] : high[0] + 1, low[1] : high[1] + 1, low[2] : high[2] + 1]
    return bool((high - low).max() <= 1 and box.sum() + (not free[place]) == box.size)


def neighbours(free: np.ndarray, voxel: int) -> list[int]:
    """Return the voxels to which one step leads without cutting a corner: up to 8, or 26; by number."""
    place = np.unravel_index(voxel, free.shape)
    axes = [range(max(at - 1, 0), min(at + 2, size)) for at, size in zip(place, free.shape, strict=True)]
    box = np.ravel_multi_index(np.ix_(*axes), free.shape).reshape(-1).tolist()
    return [near for near in box if near != voxel and step_is_free(free, voxel, near)]


@lean_kernel
def coverage_functional(
    cells: np.ndarray, costs: np.ndarray, density: np.ndarray, number: int
) -> tuple[float, int]:
    """Return H = Σ d(q, p)² φ(q) over the cell with a number (sect. 3, f(x) = x²), and its count of voxels.

    Args:
        cells: (X, Y, Z) int32, the number of the cell of each voxel.
        costs: d(q, p) of each voxel q.
        density: φ.
        number: Of the cell.
    """
    functional, voxels = 0.0, 0
    for x in range(cells.shape[0]):
        for y in range(cells.shape[1]):
            for z in range(cells.shape[2]):
                if cells[x, y, z] == number:
                    cost = costs[x, y, z]
                    functional += cost * cost * np.float64(density[x, y, z])
                    voxels += 1
    return functional, voxels


class CellFunctional:
    """The coverage functional of one robot's cell, for any place of the robot in it (eq. 3)."""

    def __init__(
        self,
        space: Tessellation,
        traversal_cost: np.ndarray,
        density: np.ndarray,
        cell: np.ndarray,
        metric: tuple[float, bool],
    ) -> None:
        """Consider the cell alone: paths do not leave it.

        Args:
            space: Memory for tessellations; overwritten.
            traversal_cost: (X, Y, Z) float32, as the tessellation had it.
            density: φ.
            cell: (X, Y, Z) bool, the cell.
            metric: `length_cost` and `by_length` of `tessellate`.
        """
        self._space, self._density, self._cell, self._metric = space, density, cell, metric
        self._traversal_cost = np.where(cell, traversal_cost, np.float32(np.inf))

    def value(self, voxel: int) -> float:
        """Return H for a robot in this voxel; inf if a part of the cell cannot be reached from there."""
        tessellate(self._space, self._traversal_cost, np.array([voxel]), *self._metric)
        found, reached = coverage_functional(self._space.cells, self._space.costs, self._density, 0)
        return found if reached == np.isfinite(self._traversal_cost).sum() else math.inf

    def step(self, voxel: int) -> int:
        """Return the neighbour in the cell at which H is least; the voxel itself if none is less (eq. 3)."""
        best, least = voxel, self.value(voxel)
        for near in neighbours(self._cell, voxel):
            value = self.value(near)
            if value < least:
                best, least = near, value
        return best
