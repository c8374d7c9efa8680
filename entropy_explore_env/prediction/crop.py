"""The part of a belief that a prediction is made from: a horizontal crop of cells around a place.

Cells are squares of 0.2 m in the band of heights that a body passes. Their lattice begins at the lower corner
of the workspace, whatever the size of its voxels: a cell is made up of all voxels that it overlaps. A crop
begins at a multiple of 16 cells, the network's coarsest step, so that a prediction does not change because a
robot moves on. Voxels count as measured once their precision is above the prior's.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.errors import SettingError
from entropy_explore_env.prediction.unet import Form
from entropy_explore_env.settings.grid import Grid

CELL_M = 0.2
"""Edge of a cell."""
CELLS = 128
"""N, cells of a crop along x and along y: 25.6 m."""
PLANS = Form(CELLS, 1, CELL_M, (16, 32, 64, 64))
"""What a network for plans is."""
UNPREDICTED = -1.0
"""In place of a probability: nothing is predicted."""
STEP = 16
"""Crops begin at multiples of this many cells."""
CHANNELS = ("solid", "free", "outside")
"""What is told of a cell: shares of its voxels measured as covered and as free; 1 outside the workspace."""
SOLID, FREE, OUTSIDE = range(len(CHANNELS))

ROUNDING = 1e-6
"""A cell and a voxel overlap by more than this share of a cell; what is a multiple but for less, is one."""
_FARTHEST_M = 1e12
"""Numbers of cells farther off would not be whole any more."""
_COVERED = 0.5
"""What was measured is covered above this coverage."""


class Belief(NamedTuple):
    """A robot's belief, and what of its grid matters here."""

    size: tuple[int, int, int]
    """(X, Y, Z) voxels."""
    voxel_size_m: float
    prior_precision: float
    """1/σ² of voxels that were never measured."""
    mean: np.ndarray
    """(V,) float32, expected coverage."""
    precision: np.ndarray
    """(V,) float32, 1/σ² of it."""


class Window(NamedTuple):
    """Where a crop lies in the lattice of cells, and in which layers of voxels."""

    x: int
    """Number of its first cell along x; below 0 before the workspace begins."""
    y: int
    low: int
    """First layer of the band."""
    high: int
    """Layer after the last one."""


@lean_kernel
def window_at(belief, place, radius):
    """Return the Window around a place, for a body that reaches so far above and below it.

    Args:
        belief: Belief.
        place: x, y, z in grid units.
        radius: Of the body, voxel edges.
    """
    layers = belief.size[2]
    low = min(max(math.floor(place[2] - radius + ROUNDING), 0), layers - 1)
    high = min(max(math.floor(place[2] + radius - ROUNDING), low), layers - 1) + 1
    first = first_cell(belief, place[0], CELL_M, CELLS), first_cell(belief, place[1], CELL_M, CELLS)
    return Window(first[0], first[1], low, high)


@inlined_kernel
def first_cell(belief, at, cell_m, cells):
    """Return where a crop of cells around a coordinate in grid units begins."""
    return math.floor(at * belief.voxel_size_m / (cell_m * STEP) + 0.5) * STEP - cells // 2


@inlined_kernel
def cell_at(belief, at):
    """Return the number of the cell that a coordinate in grid units lies in."""
    return math.floor(at * belief.voxel_size_m / CELL_M + ROUNDING)


@inlined_kernel
def overlapped(cell, per_cell, voxels):
    """Return (first, last) of the `voxels` along an axis that a cell overlaps: from `first` up to `last`."""
    first, last = math.floor((cell + ROUNDING) * per_cell), math.ceil((cell + 1 - ROUNDING) * per_cell)
    return max(first, 0), min(last, voxels)


@lean_kernel
def count_measured(belief, x, y, z):
    """Return what of a box of voxels was measured; x, y and z are (first, last) as of `overlapped`.

    Returns:
        (covered, free, most): numbers of voxels, and the largest expected coverage; -1 = none was measured.
    """
    threshold = np.float32(belief.prior_precision) * np.float32(1.0 + ROUNDING)
    covered, free, most, size = 0, 0, np.float32(-1.0), belief.size
    for i in range(x[0], x[1]):
        for j in range(y[0], y[1]):
            column = (i * size[1] + j) * size[2]
            for voxel in range(column + z[0], column + z[1]):
                if belief.precision[voxel] > threshold:
                    mean = belief.mean[voxel]
                    most = max(most, mean)
                    if mean > _COVERED:
                        covered += 1
                    else:
                        free += 1
    return covered, free, most


@lean_kernel
def pool_cells(belief, window, cells, solid):
    """Tell of each cell of a crop what is measured.

    Args:
        belief: Belief.
        window: Window.
        cells: (3, N, N) float32, filled in: CHANNELS.
        solid: (N, N) float32, filled in: expected coverage of the most covered voxel that was measured; -1
            where none was, 1 outside the workspace.
    """
    per_cell, size, band = CELL_M / belief.voxel_size_m, belief.size, (window.low, window.high)
    for i in range(CELLS):
        x = overlapped(window.x + i, per_cell, size[0])
        for j in range(CELLS):
            y = overlapped(window.y + j, per_cell, size[1])
            covered, free, most = count_measured(belief, x, y, band)
            voxels = max(x[1] - x[0], 0) * max(y[1] - y[0], 0) * (band[1] - band[0])
            outside = voxels == 0
            cells[SOLID, i, j] = 0.0 if outside else covered / voxels
            cells[FREE, i, j] = 0.0 if outside else free / voxels
            cells[OUTSIDE, i, j] = 1.0 if outside else 0.0
            solid[i, j] = 1.0 if outside else most


class Around(NamedTuple):
    """A belief around a place, as it was given from outside and checked."""

    belief: Belief
    place: tuple[float, float, float]
    """x, y, z in grid units."""
    radius: float
    """The band reaches so far above and below the place, voxel edges."""


def around(
    grid: Grid,
    mean: np.ndarray,
    precision: np.ndarray,
    sigma_prior: float,
    place_m: np.ndarray,
    body_radius_m: float,
) -> Around:
    """Return a belief around a place for compiled code.

    Args:
        grid: Of the belief.
        mean: (X, Y, Z) float32, expected coverage.
        precision: (X, Y, Z) float32, 1/σ² of it.
        sigma_prior: σ of voxels that were never measured.
        place_m: x, y, z, map frame; further numbers do not count.
        body_radius_m: The band of heights reaches so far above and below the place.

    Raises:
        SettingError: The belief is not of the grid, or a number is not finite.
    """
    for name, numbers in (("mean", mean), ("precision", precision)):
        if numbers.shape != grid.shape:
            raise SettingError(name, numbers.shape, f"an array of shape {grid.shape}")
        if not np.isfinite(numbers).all():
            raise SettingError(name, "a number that is not finite", "finite numbers alone")
    there = np.asarray(place_m, np.float64)[:3]
    if there.shape != (3,) or not (np.abs(there) < _FARTHEST_M).all():
        raise SettingError("place_m", place_m, "x, y and z, finite")
    if not 0.0 < sigma_prior < math.inf:
        raise SettingError("sigma_prior", sigma_prior, "a finite number above 0")
    belief = Belief(
        grid.shape,
        grid.voxel_size_m,
        float(np.float32(sigma_prior**-2)),
        np.ascontiguousarray(mean, np.float32).reshape(-1),
        np.ascontiguousarray(precision, np.float32).reshape(-1),
    )
    x, y, z = ((there - grid.origin_m) / grid.voxel_size_m).tolist()
    return Around(belief, (x, y, z), body_radius_m / grid.voxel_size_m)


def pool_crop(there: Around) -> tuple[np.ndarray, np.ndarray, Window]:
    """Return `cells` and `solid` around a place as `pool_cells` fills them in, and where the crop lies."""
    cells = np.zeros((len(CHANNELS), CELLS, CELLS), np.float32)
    solid = np.zeros((CELLS, CELLS), np.float32)
    window = Window(*window_at(there.belief, there.place, there.radius))
    pool_cells(there.belief, window, cells, solid)
    return cells, solid, window
