"""Controls of Voronoi coverage: where in its geodesic cell a robot goes (Bhattacharya, Michael & Kumar 2010).

A cell is the (N,) int64 numbers of its voxels, in C order and ascending; of equal voxels the first is taken.
Density φ is (X, Y, Z) float32 > 0, without a unit. Costs are (X, Y, Z) float64, those of the tessellation
that the cells come from (belief/paths/geodesic_cells.py).
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.belief.paths.geodesic_cells import UNREACHED


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
