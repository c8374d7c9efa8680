"""The elevation map of a voxel belief, and its completion where nothing is known yet (Sujan, sects. 2.1-2.2).

A 2.5-D map: one height a column, that of the highest voxel that is believed to be covered. Overhangs and
ceilings count as ground, so that it is meant for open country. Heights are in metres in the map frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.validation import is_number

_SWEEPS_PER_CELL = 40
"""Relaxation ends after this many sweeps for each cell of the widest gap, whatever is left of its changes."""
_CROSS = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]])
"""The four neighbours of a column."""


class ElevationMap(NamedTuple):
    """What is known of the ground of (X, Y) columns."""

    height_m: np.ndarray
    """(X, Y) float64, mean height of the ground; that of the floor of the workspace where it is not known."""
    sigma_m: np.ndarray
    """(X, Y) float64, its standard deviation; inf where it is not known."""
    measurements: np.ndarray
    """(X, Y) float64, how many measurements from close by its precision is worth; 0 = not known."""

    @property
    def known(self) -> np.ndarray:
        """(X, Y) bool, which columns have a measured height."""
        return self.measurements > 0.0


def elevation_map(
    mean: np.ndarray, precision: np.ndarray, grid: Grid, sigma_prior: float, sigma_min: float
) -> ElevationMap:
    """Return the heights of the ground in a voxel belief.

    The ground of a column ends in its highest measured voxel with a mean coverage μ above ½, at the height
    vsz·(k + μ) above the floor; its standard deviation is that of the coverage, times vsz. Where no voxel is
    covered and the lowest one is measured, the ground is the floor.

    Args:
        mean: (X, Y, Z) float32 expected coverage.
        precision: (X, Y, Z) float32, 1/σ².
        grid: The voxels, Z > 1.
        sigma_prior: Standard deviation of the coverage of a voxel that was never measured.
        sigma_min: Least standard deviation of a measured coverage (`RangeSensor.sigma_min`), the unit of
            `measurements`.

    Raises:
        SettingError: The arrays do not have the grid's shape, the grid is flat, or a deviation is not > 0.
    """
    for name, array in (("mean", mean), ("precision", precision)):
        if not isinstance(array, np.ndarray) or array.shape != grid.shape:
            raise SettingError(name, getattr(array, "shape", array), f"an array {grid.shape}")
    if grid.flat:
        raise SettingError("Grid.shape", grid.shape, "more than one voxel high")
    for name, sigma in (("sigma_prior", sigma_prior), ("sigma_min", sigma_min)):
        if not is_number(sigma) or not 0.0 < sigma < math.inf:
            raise SettingError(name, sigma, "a finite number > 0")
    ground = np.empty((3, *grid.shape[:2]))
    prior, unit = np.float32(sigma_prior**-2), sigma_min**-2
    _fill_ground(np.asarray(mean, np.float32), np.asarray(precision, np.float32), prior, unit, ground)
    heights = grid.origin_m[2] + grid.voxel_size_m * ground[0]
    return ElevationMap(heights, grid.voxel_size_m * ground[1], ground[2])


@lean_kernel
def _fill_ground(mean, precision, prior, unit, ground):
    """Fill (3, X, Y): height and deviation in voxel edges, and number of measurements, of columns' ground.

    `prior` is the precision of a voxel that was never measured, `unit` that of one measurement.
    """
    for i in range(mean.shape[0]):
        for j in range(mean.shape[1]):
            k = mean.shape[2] - 1
            while k >= 0 and not (precision[i, j, k] > prior and mean[i, j, k] > STOP_AT_COVERED):
                k -= 1
            voxel = max(k, 0)
            measured = precision[i, j, voxel] > prior
            known = np.float64(precision[i, j, voxel])
            ground[0, i, j] = k + np.float64(mean[i, j, voxel]) if k >= 0 else 0.0
            ground[1, i, j] = 1.0 / math.sqrt(known) if measured else math.inf
            ground[2, i, j] = (known - prior) / unit if measured else 0.0


def completed(
    height_m: np.ndarray, known: np.ndarray, tolerance_m: float = 1e-4, begin_m: np.ndarray | None = None
) -> np.ndarray:
    """Return heights with unknown columns filled in: each the mean of its neighbours (Sujan, fig. 7).

    The paper's Markovian approximation: unknown columns begin at the lowest known height, the worst case
    for a robot at an edge, and take the mean of their four neighbours (fewer at the border) until nothing
    changes. The limit solves Laplace's equation with the known heights fixed. Relaxed successively, with
    the over-relaxation (Young 1954) that suits the widest gap.

    Args:
        height_m: (X, Y), heights; what stands in unknown columns does not matter.
        known: (X, Y) bool, which are fixed.
        tolerance_m: Most by which a height may differ from the limit, about.
        begin_m: (X, Y) finite heights at which unknown columns begin, such as those completed before: the
            limit is the same, and nearer. None = the lowest known height.

    Returns:
        (X, Y) float64; all zeros where nothing is known.

    Raises:
        SettingError: The shapes differ, a known height is not finite, or the tolerance is not > 0.
    """
    heights = np.array(height_m, np.float64)
    fixed = np.asarray(known)
    if heights.ndim != 2 or fixed.shape != heights.shape or fixed.dtype != np.bool_:
        raise SettingError("known", f"{fixed.shape} {fixed.dtype}", f"{heights.shape} bool, two axes")
    if not np.isfinite(heights[fixed]).all():
        raise SettingError("height_m", "inf or nan", "finite where it is known")
    if not is_number(tolerance_m) or not 0.0 < tolerance_m < math.inf:
        raise SettingError("tolerance_m", tolerance_m, "a finite number > 0")
    if not fixed.any():
        return np.zeros(heights.shape)
    if begin_m is not None and (begin_m.shape != heights.shape or not np.isfinite(begin_m).all()):
        raise SettingError("begin_m", begin_m.shape, f"finite numbers {heights.shape}")
    heights[~fixed] = heights[fixed].min() if begin_m is None else begin_m[~fixed]
    if not fixed.all():
        heights = _relaxed(heights, fixed, float(tolerance_m))
    return heights


def _relaxed(heights: np.ndarray, fixed: np.ndarray, tolerance: float) -> np.ndarray:
    """Return heights with those that are not fixed relaxed.

    The slowest error over a gap of D columns that ends at the border falls by ρ = (1 + cos(π/(2D + 1)))/2 in
    a sweep of Jacobi's; the best factor for it is ω = 2/(1 + √(1 - ρ²)) (Young 1954).
    """
    gap = int(np.max(np.asarray(ndimage.distance_transform_cdt(~fixed, "taxicab"))))
    slowest = 0.5 * (1.0 + math.cos(math.pi / (2 * gap + 1)))
    factor = 2.0 / (1.0 + math.sqrt(1.0 - slowest * slowest))
    neighbours = ndimage.convolve(np.ones(fixed.shape), _CROSS, mode="constant")
    shares = np.where(fixed, 0.0, factor / np.maximum(neighbours, 1.0))
    (white, black), each = _by_colour(heights), _by_colour(shares)
    _relax(white, black, *each, factor, _SWEEPS_PER_CELL * (gap + 10), tolerance)
    relaxed = np.empty((len(white), white.shape[1], 2))
    rows = np.arange(len(white))
    relaxed[rows, :, (rows + 1) % 2], relaxed[rows, :, rows % 2] = white, black
    return relaxed.reshape(len(white), -1)[1:-1, 1 : heights.shape[1] + 1].copy()


def _by_colour(columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return columns (X, Y) by the two colours of a chessboard: those with an odd i + j, and the others.

    Each is (X + 2, W), with a margin of zeros: column j is the (j // 2)th one of its colour in its row.
    """
    padded = np.pad(columns, ((1, 1), (1, 1 + columns.shape[1] % 2)))
    pairs, rows = padded.reshape(len(padded), -1, 2), np.arange(len(padded))
    return pairs[rows, :, (rows + 1) % 2], pairs[rows, :, rows % 2]


@lean_kernel
def _relax(white, black, white_shares, black_shares, factor, sweeps, tolerance):
    """Relax heights by successive over-relaxation, in place, until they hardly change.

    Errors fall by ω - 1 a sweep, so that changes below (2 - ω) of the tolerance leave less than it.

    Args:
        white: (X + 2, W) float64, heights of one colour, which a sweep relaxes first; see `_by_colour`.
        black: (X + 2, W) float64, those of the other.
        white_shares: (X + 2, W) float64: of columns to relax, ω over how many neighbours they have, or 0.
        black_shares: (X + 2, W) float64, those of the other.
        factor: ω.
        sweeps: Most sweeps.
    """
    limit = (2.0 - factor) * tolerance
    for _ in range(sweeps):
        moving = _relax_colour(white, black, white_shares, factor, 1, limit)
        moving += _relax_colour(black, white, black_shares, factor, 0, limit)
        if moving == 0:
            return


@lean_kernel
def _relax_colour(own, other, shares, factor, white, limit):
    """Relax the squares of a colour; returns how many changed by more than a limit.

    The margin's squares are relaxed, too, and do not change: their shares are 0.
    """
    count, width = 0, own.shape[1]
    for row in range(1, own.shape[0] - 1):
        odd = (row + white) % 2
        cells, part = own[row, 1 - odd : width - odd], shares[row, 1 - odd : width - odd]
        above, below = other[row - 1, 1 - odd : width - odd], other[row + 1, 1 - odd : width - odd]
        left, right = other[row, : width - 1], other[row, 1:]
        for k in range(len(cells)):  # contiguous, and without a branch: the compiler makes vectors of it
            beside = above[k] + below[k] + left[k] + right[k]
            change = part[k] * beside - factor * cells[k]
            change = change if part[k] > 0.0 else 0.0
            cells[k] += change
            count += abs(change) > limit
    return count
