"""Predictions of what was never measured in a volume, from a robot's own belief alone.

A crop is 64 × 64 cells of 0.4 m around the robot in 32 layers, which begin at the floor of the workspace, or
higher where it is taller. Of each cell it is told which shares of its voxels were measured as covered and as
free. Cells above the workspace count as solid. The network was trained in caves of 0.4 m voxels and furnished
offices of 0.25 m, for robots that fly (`training.map_predictor`).
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.errors import SettingError
from entropy_explore_env.prediction.crop import (
    ROUNDING,
    UNPREDICTED,
    Around,
    count_measured,
    first_cell,
    overlapped,
)
from entropy_explore_env.prediction.predictor import MapPredictor, Predicting
from entropy_explore_env.prediction.unet import Form, fill_unmeasured, infer
from entropy_explore_env.prediction.weights import LEARNED, read_network
from entropy_explore_env.settings.grid import Grid

VOLUMES = Form(64, 32, 0.4, (16, 32, 40, 40))
"""What a network for volumes is."""
SHIPPED_VOLUMES = LEARNED / "volumes.safetensors"
"""The weights that come with the library, for volumes."""
_CELLS, _LAYERS, _CELL_M = VOLUMES.cells, VOLUMES.layers, VOLUMES.cell_m


class VolumeWindow(NamedTuple):
    """Where a crop lies in the lattice of cells, which begins at the lower corner of the workspace."""

    x: int
    """Number of its first cell along x; below 0 before the workspace begins."""
    y: int
    z: int


@lean_kernel
def volume_window(belief, place):
    """Return the VolumeWindow around a place in grid units."""
    x = first_cell(belief, place[0], _CELL_M, _CELLS)
    y = first_cell(belief, place[1], _CELL_M, _CELLS)
    layers = math.ceil(belief.size[2] * belief.voxel_size_m / _CELL_M - ROUNDING)
    low = first_cell(belief, place[2], _CELL_M, _LAYERS)
    return VolumeWindow(x, y, max(min(low, layers - _LAYERS), 0))


@lean_kernel
def pool_volume(belief, window, cells, solid):
    """Fill in what was measured of each cell of a crop.

    Args:
        belief: Belief.
        window: VolumeWindow.
        cells: (2·L + 1, N, N) float32, filled in: shares of voxels covered and free in each layer; 1 outside
            the workspace.
        solid: (L, N, N) float32, filled in: the largest expected coverage that was measured; -1 where
            nothing was, 1 outside the workspace.
    """
    per_cell, size = _CELL_M / belief.voxel_size_m, belief.size
    for i in range(_CELLS):
        x = overlapped(window.x + i, per_cell, size[0])
        for j in range(_CELLS):
            y = overlapped(window.y + j, per_cell, size[1])
            outside = x[1] <= x[0] or y[1] <= y[0]
            cells[2 * _LAYERS, i, j] = 1.0 if outside else 0.0
            for k in range(_LAYERS):
                z = overlapped(window.z + k, per_cell, size[2])
                if outside or z[1] <= z[0]:
                    cells[k, i, j], cells[_LAYERS + k, i, j] = 0.0 if outside else 1.0, 0.0
                    solid[k, i, j] = 1.0
                    continue
                covered, free, most = count_measured(belief, x, y, z)
                voxels = (x[1] - x[0]) * (y[1] - y[0]) * (z[1] - z[0])
                cells[k, i, j], cells[_LAYERS + k, i, j] = covered / voxels, free / voxels
                solid[k, i, j] = most


@lean_kernel
def spread(belief, window, cells, solid, out):
    """Fill in (V,) the probability of each voxel: its cell's, where nothing of the cell was measured."""
    size, per_voxel = belief.size, belief.voxel_size_m / _CELL_M
    out[:] = UNPREDICTED
    for x in range(size[0]):
        i = math.floor((x + 0.5) * per_voxel + ROUNDING) - window.x
        if not 0 <= i < _CELLS:
            continue
        for y in range(size[1]):
            j = math.floor((y + 0.5) * per_voxel + ROUNDING) - window.y
            if not 0 <= j < _CELLS:
                continue
            column = (x * size[1] + y) * size[2]
            for z in range(size[2]):
                k = math.floor((z + 0.5) * per_voxel + ROUNDING) - window.z
                if 0 <= k < _LAYERS and cells[k, i, j] + cells[_LAYERS + k, i, j] == 0.0:
                    out[column + z] = solid[k, i, j]


@lean_kernel
def predict_volume(predicting, belief, place, out):
    """Fill in (V,) what is predicted around a place in grid units."""
    window = volume_window(belief, place)
    pool_volume(belief, window, predicting.cells, predicting.solid)
    infer(predicting.network, predicting.planes, predicting.cells)
    fill_unmeasured(predicting.planes, predicting.solid)
    spread(belief, window, predicting.cells, predicting.solid, out)


class VolumePredictor(MapPredictor[np.ndarray]):
    """A predictor of volumes, at all heights.

    It returns (X, Y, Z) float32, read-only: the probability of each voxel to be solid. That is UNPREDICTED,
    -1, of voxels that were measured, that share a cell with one that was, or that lie outside of the crop.
    """

    form = VOLUMES

    def _predicted(self, grid: Grid, there: Around, predicting: Predicting) -> np.ndarray:
        if grid.flat:
            raise SettingError("Grid.shape", grid.shape, "several layers of voxels: `Predictor` is for plans")
        out = np.empty(grid.shape, np.float32)
        predict_volume(predicting, there.belief, there.place, out.reshape(-1))
        out.setflags(write=False)
        return out


def pool_volume_crop(there: Around) -> tuple[np.ndarray, VolumeWindow]:
    """Return `cells` around a place as `pool_volume` fills them in, and where the crop lies."""
    cells = np.zeros((VOLUMES.channels, _CELLS, _CELLS), np.float32)
    window = VolumeWindow(*volume_window(there.belief, there.place))
    pool_volume(there.belief, window, cells, np.zeros((_LAYERS, _CELLS, _CELLS), np.float32))
    return cells, window


def read_volume_predictor(file: Path) -> VolumePredictor:
    """Read a predictor from a file that `training.map_predictor` wrote.

    Raises:
        SettingError: See `read_network`.
    """
    return VolumePredictor(read_network(file, VOLUMES))


@cache
def shipped_volume_predictor() -> VolumePredictor:
    """Return the predictor of volumes that comes with the library."""
    return read_volume_predictor(SHIPPED_VOLUMES)
