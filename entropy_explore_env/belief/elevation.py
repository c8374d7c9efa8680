"""The elevation map of a voxel belief, and its completion where nothing is known yet (Sujan, sects. 2.1-2.2).

A 2.5-D map: one height a column, that of the highest voxel that is believed to be covered. Overhangs and
ceilings count as ground, so that it is meant for open country. Heights are in metres in the map frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.validation import is_number

_SWEEPS_AT_ONCE, _ROWS_AT_ONCE = 6, 32
"""Sweeps that go over the rows together, and rows of each before the next one: what is fastest."""
_SWEEPS_PER_CELL = 40
"""Relaxation ends after this many sweeps for each cell of the widest gap, whatever is left of its changes."""


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
    rows, columns = heights.shape
    board = _new_board(rows, columns)
    gap = _set_out(board, heights, fixed, np.empty(heights.shape, np.int32))
    slowest = 0.5 * (1.0 + math.cos(math.pi / (2 * gap + 1)))
    factor = 2.0 / (1.0 + math.sqrt(1.0 - slowest * slowest))
    _share_out(board, fixed, factor)
    before = board._replace(white=np.empty_like(board.white), black=np.empty_like(board.black))
    _relax(
        board, before, factor, _SWEEPS_PER_CELL * (gap + 10), tolerance, np.zeros(_SWEEPS_AT_ONCE, np.int64)
    )
    _take_in(board, heights)
    return heights


class Board(NamedTuple):
    """Columns like the squares of a chessboard, with a margin of zeros; those of a colour beside each other.

    In row i the square j is the (j // 2)th one of its colour, so that W = (Y + 3) // 2.
    """

    white: np.ndarray
    """(X + 2, W) float64, heights where i + j is odd."""
    black: np.ndarray
    """(X + 2, W) float64, the others."""
    white_shares: np.ndarray
    """(X + 2, W) float64: of columns to relax, the factor over how many neighbours they have, or 0."""
    black_shares: np.ndarray
    """(X + 2, W) float64, likewise."""


def _new_board(rows: int, columns: int) -> Board:
    """Return an empty board of (X, Y) squares."""
    shape = rows + 2, (columns + 3) // 2
    return Board(*(np.zeros(shape) for _ in range(4)))


@lean_kernel
def _set_out(board, heights, fixed, gaps):
    """Put heights on a board; returns the widest gap, in steps from a column to the nearest fixed one.

    Args:
        heights: (X, Y) float64.
        fixed: (X, Y) bool, at least one of them.
        gaps: (X, Y) int32, scratch space.
    """
    rows, columns = heights.shape
    far = np.int32(rows + columns)
    for i in range(rows):
        for j in range(columns):
            squares = board.white if (i + j) % 2 == 1 else board.black  # the margin moves both by one
            squares[i + 1, (j + 1) // 2] = heights[i, j]
            gap = np.int32(0) if fixed[i, j] else far
            if i > 0:
                gap = min(gap, gaps[i - 1, j] + np.int32(1))
            if j > 0:
                gap = min(gap, gaps[i, j - 1] + np.int32(1))
            gaps[i, j] = gap
    widest = np.int32(0)
    for i in range(rows - 1, -1, -1):
        for j in range(columns - 1, -1, -1):
            gap = gaps[i, j]
            if i + 1 < rows:
                gap = min(gap, gaps[i + 1, j] + np.int32(1))
            if j + 1 < columns:
                gap = min(gap, gaps[i, j + 1] + np.int32(1))
            gaps[i, j] = gap
            widest = max(widest, gap)
    return widest


@lean_kernel
def _share_out(board, fixed, factor):
    """Fill in the shares of the columns that are not fixed."""
    rows, columns = fixed.shape
    for i in range(rows):
        for j in range(columns):
            if not fixed[i, j]:
                neighbours = (i > 0) + (i + 1 < rows) + (j > 0) + (j + 1 < columns)
                shares = board.white_shares if (i + j) % 2 == 1 else board.black_shares
                shares[i + 1, (j + 1) // 2] = factor / max(neighbours, 1)


@lean_kernel
def _take_in(board, heights):
    """Fill in (X, Y) heights from a board."""
    rows, columns = heights.shape
    for i in range(rows):
        for j in range(columns):
            squares = board.white if (i + j) % 2 == 1 else board.black
            heights[i, j] = squares[i + 1, (j + 1) // 2]


@lean_kernel
def _relax(board, before, factor, sweeps, tolerance, moving):
    """Successive over-relaxation by ω, `factor`: all white squares, then all black ones, in a sweep.

    Errors fall by ω - 1 a sweep, so that changes below (2 - ω) of the tolerance leave less than it. Some
    sweeps go over the rows together, each two rows behind the one before: the rows stay in the cache. Where
    the first of them was the last that is needed, they are taken back, and it is done alone. Scratch space:
    `before`, another Board, and `moving`, (S,) int64 for S sweeps together.
    """
    limit, left = (2.0 - factor) * tolerance, sweeps
    while left > 0:
        together = min(len(moving), left)
        _copy(board.white, before.white)
        _copy(board.black, before.black)
        _sweep(board, factor, limit, together, moving)
        needed = 0
        while needed < together and moving[needed] > 0:
            needed += 1
        if needed == together:
            left -= together
            continue
        if needed + 1 < together:
            _copy(before.white, board.white)
            _copy(before.black, board.black)
            _sweep(board, factor, limit, needed + 1, moving)
        break


@inlined_kernel
def _copy(source, target):
    """Copy numbers from one array to another of the same shape."""
    for row in range(source.shape[0]):
        for column in range(source.shape[1]):
            target[row, column] = source[row, column]


@lean_kernel
def _sweep(board, factor, limit, together, moving):
    """Relax every square this many times; `moving` counts those that a sweep changed by more than a limit."""
    rows = len(board.white) - 2
    for sweep in range(together):
        moving[sweep] = 0
    for front in range(_ROWS_AT_ONCE, rows + 2 * together + _ROWS_AT_ONCE, _ROWS_AT_ONCE):
        for sweep in range(together):
            last = front - 2 * sweep
            moving[sweep] += _relax_rows(board.white, board.black, board.white_shares, factor, last, 1, limit)
            moving[sweep] += _relax_rows(
                board.black, board.white, board.black_shares, factor, last - 1, 0, limit
            )


@lean_kernel
def _relax_rows(own, other, shares, factor, last, white, limit):
    """Relax the squares of a colour in some rows; returns how many changed by more than a limit.

    The margin's squares are relaxed, too, and do not change: their shares are 0. The rows are those within
    the board of the `_ROWS_AT_ONCE` rows that end with the last one.
    """
    count = 0
    for row in range(max(last - _ROWS_AT_ONCE + 1, 1), min(last, own.shape[0] - 2) + 1):
        odd = (row + white) % 2
        cells, part = own[row, 1 - odd : own.shape[1] - odd], shares[row, 1 - odd : own.shape[1] - odd]
        above, below = (
            other[row - 1, 1 - odd : own.shape[1] - odd],
            other[row + 1, 1 - odd : own.shape[1] - odd],
        )
        left, right = other[row, : own.shape[1] - 1], other[row, 1:]
        for k in range(len(cells)):  # contiguous, and without a branch: the compiler makes vectors of it
            beside = above[k] + below[k] + left[k] + right[k]
            change = part[k] * beside - factor * cells[k]
            change = change if part[k] > 0.0 else 0.0
            cells[k] += change
            count += abs(change) > limit
    return count
