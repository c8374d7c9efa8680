"""Predictions of what was never measured around a place, from a robot's own belief alone.

The network was trained in floor plans in which ground robots drive (`training.map_predictor`). Robots that
fly get the prediction for the band of heights about them, as if it were such a plan; in caves and over
terrain it was never tried.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.prediction.crop import (
    CELL_M,
    CELLS,
    PLANS,
    ROUNDING,
    Around,
    Window,
    around,
    pool_cells,
    window_at,
)
from entropy_explore_env.prediction.unet import (
    LEVELS,
    Form,
    Network,
    Planes,
    fill_unmeasured,
    infer,
    new_planes,
)
from entropy_explore_env.prediction.weights import SHIPPED, check_form, read_network
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.observation import Observation

Predicted = TypeVar("Predicted", covariant=True)
"""What a MapPredictor returns."""


class Predicting(NamedTuple):
    """What compiled code needs to predict, one for each thread."""

    network: Network
    planes: Planes
    cells: np.ndarray
    """(2·L + 1, N, N) float32, scratch."""
    solid: np.ndarray
    """(L, N, N) float32, filled in: probability of each cell to be solid."""


def new_predicting(network: Network, form: Form = PLANS) -> Predicting:
    """Return memory for the predictions of one thread by a network of a form."""
    cells = np.zeros((form.channels, form.cells, form.cells), np.float32)
    solid = np.zeros((form.layers, form.cells, form.cells), np.float32)
    return Predicting(network, new_planes(form), cells, solid)


def scratch_bytes() -> int:
    """Return about the bytes that the predictions of one thread need in observations."""
    sides = [(PLANS.side >> level) + 2 for level in range(LEVELS)]
    planes = sum(4 * width * side**2 for width, side in zip(PLANS.widths, sides, strict=True))
    return 4 * planes + 4 * (PLANS.channels + 1) * CELLS**2


@lean_kernel
def predict_cells(predicting, belief, place, radius):
    """Fill in `solid` of a Predicting, around a place in grid units, for a body of a radius in voxel edges.

    Returns:
        The Window of the crop.
    """
    window = window_at(belief, place, radius)
    pool_cells(belief, window, predicting.cells, predicting.solid[0])
    infer(predicting.network, predicting.planes, predicting.cells)
    fill_unmeasured(predicting.planes, predicting.solid)
    return window


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a predictor says of N × N cells around a place; equal only to itself.

    Attributes:
        solid: (N, N) float32, probability of each cell (x, y) to be solid in some voxel of the band. Of cells
            in which something was measured, the expected coverage of the most covered voxel; 1 outside the
            workspace.
        measured: (N, N) bool, in which cells something was measured.
        origin_m: (2,) float64, lower corner of cell (0, 0), map frame.
        cell_m: Edge of a cell.
        layers: First layer of voxels of the band, and the layer after the last one.
    """

    solid: np.ndarray
    measured: np.ndarray
    origin_m: np.ndarray
    cell_m: float
    layers: tuple[int, int]

    def cell_of(self, place_m: np.ndarray) -> tuple[int, int]:
        """Return the cell that a place (x, y, …), map frame, lies in; it may be outside of the prediction."""
        x, y = (np.asarray(place_m, np.float64)[:2] - self.origin_m) / self.cell_m + ROUNDING
        return math.floor(x), math.floor(y)

    def __repr__(self) -> str:
        """Return its size, where it lies, and how much of it is measured."""
        x, y = self.origin_m
        share = float(self.measured.mean())
        size = f"{CELLS} × {CELLS} cells of {self.cell_m:g} m from ({x:.3g}, {y:.3g}) m"
        return f"Prediction({size}, {share:.1%} measured)"


class MapPredictor(ABC, Generic[Predicted]):
    """A network that predicts what was never measured around a place."""

    form: ClassVar[Form]
    """What its network is."""

    def __init__(self, network: Network) -> None:
        """Take a network that `read_network` read.

        Raises:
            SettingError: It is of another form.
        """
        check_form(network, self.form)
        self.network = network

    def predict(
        self,
        grid: Grid,
        mean: np.ndarray,
        precision: np.ndarray,
        sigma_prior: float,
        place_m: np.ndarray,
        body_radius_m: float,
    ) -> Predicted:
        """Predict around a place; a workspace smaller than the crop is predicted as it is.

        Args:
            grid: Of the belief.
            mean: (X, Y, Z) float32, expected coverage.
            precision: (X, Y, Z) float32, 1/σ² of it.
            sigma_prior: σ of voxels that were never measured.
            place_m: (3,) x, y, z, map frame; further numbers do not count.
            body_radius_m: The band of heights of a plan reaches so far above and below the place.

        Raises:
            SettingError: The belief is not of the grid, a number is out of its range, or nothing can be
                predicted in such a grid.
        """
        there = around(grid, mean, precision, sigma_prior, place_m, body_radius_m)
        return self._predicted(grid, there, new_predicting(self.network, self.form))

    @abstractmethod
    def _predicted(self, grid: Grid, there: Around, predicting: Predicting) -> Predicted:
        """Return what is predicted around a place, with memory that is used once."""


class Predictor(MapPredictor[Prediction]):
    """A predictor of plans; cells around a workspace smaller than the crop are outside."""

    form = PLANS

    def _predicted(self, grid: Grid, there: Around, predicting: Predicting) -> Prediction:
        window = Window(*predict_cells(predicting, there.belief, there.place, there.radius))
        measured = predicting.cells[:2].max(axis=0) > 0.0
        origin_m = np.asarray(grid.origin_m)[:2] + CELL_M * np.array([window.x, window.y])
        solid = predicting.solid[0]
        for array in (solid, measured, origin_m):
            array.setflags(write=False)
        return Prediction(solid, measured, origin_m, CELL_M, (window.low, window.high))


def read_predictor(file: Path) -> Predictor:
    """Read a predictor from a file that `training.map_predictor` wrote.

    Raises:
        SettingError: See `read_network`.
    """
    return Predictor(read_network(file))


def predicting_of(observation: Observation) -> Predicting | None:
    """Return memory for predictions of the shipped predictor; None where an observation has none."""
    return new_predicting(shipped_predictor().network) if observation.prediction else None


@cache
def shipped_predictor() -> Predictor:
    """Return the predictor that comes with the library."""
    return read_predictor(SHIPPED)
