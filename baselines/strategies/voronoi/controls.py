"""Controls of Voronoi coverage: where in its geodesic cell a robot goes (Bhattacharya, Michael & Kumar 2010).

A cell is the (N,) int64 numbers of its voxels, in C order and ascending; of equal voxels the first is taken.
Density φ is (X, Y, Z) float32 > 0, without a unit. Costs are (X, Y, Z) float64, those of the tessellation
that the cells come from (belief/paths/geodesic_cells.py).
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.paths.geodesic_cells import UNREACHED, Tessellation, tessellate
from entropy_explore_env.compilation.kernels import lean_kernel


def projected_centroid(cell: np.ndarray, density: np.ndarray, threshold: float) -> int:
    """Return the voxel of a cell that is nearest to its centroid (eqs. 6-8); UNREACHED in an empty cell.

    C = Σ q φ(q) / Σ φ(q)   over the cell;   the target is the q nearest to C, of those with φ(q) ≥ τ if
    there are any, else of all voxels of the cell.
    """
    if len(cell) == 0:
        return UNREACHED
    weights = density.reshape(-1)[cell].astype(np.float64)
    places = np.stack(np.unravel_index(cell, density.shape), axis=-1)
    sums = (weights[:, None] * np.column_stack([np.ones(len(cell)), places])).sum(axis=0)
    uncertain = weights >= threshold
    if uncertain.any():
        cell, places = cell[uncertain], places[uncertain]
    return int(cell[int(np.argmin(((places - sums[1:] / sums[0]) ** 2).sum(axis=1)))])


def nearest_uncertain(cell: np.ndarray, costs: np.ndarray, density: np.ndarray, threshold: float) -> int:
    """Return the voxel of a cell with φ ≥ τ that costs least to reach; UNREACHED if no φ is ≥ τ."""
    among = cell[density.reshape(-1)[cell] >= threshold]
    return int(among[int(np.argmin(costs.reshape(-1)[among]))]) if len(among) else UNREACHED


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
