"""Crops of beliefs against exact fractions: voxels finer and coarser than cells, borders, bands."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.prediction.crop import (
    CELL_M,
    CELLS,
    STEP,
    around,
    cell_at,
    pool_crop,
    window_at,
)
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.observation import MOST_PREDICTED
from tests.reference import prediction as reference

SIGMA_PRIOR = 30.0


def drawn_belief(shape: tuple[int, int, int], seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean, precision, and which voxels were measured: about half of them, none in a corner."""
    rng = np.random.default_rng(seed)
    measured = rng.random(shape) < 0.5
    measured[: shape[0] // 2, : shape[1] // 3] = False
    prior = np.float32(SIGMA_PRIOR**-2)
    precision = np.where(measured, np.float32(4.0), prior).astype(np.float32)
    return rng.random(shape).astype(np.float32), precision, measured


@pytest.mark.parametrize(
    ("shape", "voxel", "origin_m", "layers"),
    [
        ((37, 52, 1), Fraction(1, 10), (-1.3, 2.0, 0.0), range(1)),
        ((31, 23, 1), Fraction(1, 4), (0.0, 0.0, 0.0), range(1)),
        ((19, 33, 7), Fraction(1, 5), (4.0, -3.0, 1.0), range(2, 5)),
        ((17, 41, 9), Fraction(1, 8), (0.0, 1.0, -0.5), range(1, 6)),
        ((9, 6, 4), Fraction(1, 1), (0.0, 0.0, 0.0), range(2, 3)),
        ((1, 3, 1), Fraction(1, 20), (0.0, 0.0, 0.0), range(1)),
    ],
)
def test_cells_are_those_of_exact_fractions(shape, voxel, origin_m, layers):
    grid = Grid(shape, float(voxel), origin_m)
    mean, precision, measured = drawn_belief(shape, 3)
    height = origin_m[2] + float(voxel) * (layers.start + len(layers) / 2)
    radius_m = float(voxel) * (len(layers) - 1) / 2 if shape[2] > 1 else 0.3
    place_m = np.array([origin_m[0] + 0.4 * grid.size_m[0], origin_m[1] + 0.9 * grid.size_m[1], height])
    there = around(grid, mean, precision, SIGMA_PRIOR, place_m, radius_m)
    cells, solid, window = pool_crop(there)
    assert range(window.low, window.high) == layers
    assert (window.x, window.y) == reference.window(place_m, np.array(origin_m))
    expected, most = reference.channels(mean, measured, voxel, (window.x, window.y), layers)
    np.testing.assert_allclose(cells, expected, rtol=1e-6)
    np.testing.assert_allclose(solid, most, rtol=1e-6)
    assert 0.0 < expected[2].mean() < 1.0 and (expected[0] > 0).any()


def test_a_crop_by_hand():
    """Two voxels of 0.1 m a cell along each axis: one of four is covered, two are free, one is unknown."""
    grid = Grid((4, 6, 1), 0.1)
    mean = np.full(grid.shape, 0.5, np.float32)
    precision = np.full(grid.shape, SIGMA_PRIOR**-2, np.float32)
    for voxel, coverage in (((2, 4, 0), 0.9), ((2, 5, 0), 0.2), ((3, 4, 0), 0.1)):
        mean[voxel], precision[voxel] = coverage, 1.0
    cells, solid, window = pool_crop(around(grid, mean, precision, SIGMA_PRIOR, np.zeros(3), 0.3))
    assert window == (-64, -64, 0, 1)
    assert cells[:, 65, 66].tolist() == [0.25, 0.5, 0.0] and solid[65, 66] == np.float32(0.9)
    assert cells[:, 64, 64].tolist() == [0.0, 0.0, 0.0] and solid[64, 64] == -1.0
    assert cells[:, 63, 64].tolist() == cells[:, 66, 64].tolist() == [0.0, 0.0, 1.0]
    assert cells[2].sum() == CELLS**2 - 2 * 3


def test_the_lattice_of_cells_stays_where_it_is_while_a_robot_moves():
    grid = Grid((240, 180, 1), 0.1)
    mean, precision, _ = drawn_belief(grid.shape, 1)
    firsts = set()
    for x in np.arange(0.05, 24.0, 0.31):
        there = around(grid, mean, precision, SIGMA_PRIOR, np.array([x, 9.0, 0.0]), 0.3)
        first = window_at(there.belief, there.place, there.radius)[0]
        firsts.add(first)
        middle = cell_at(there.belief, there.place[0]) - first
        assert MOST_PREDICTED // 2 <= middle < CELLS - MOST_PREDICTED // 2
        assert first % STEP == 0 and abs((first + CELLS / 2) * CELL_M - x) <= STEP / 2 * CELL_M + 1e-9
    assert len(firsts) == 8


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"mean": np.full((4, 6, 1), np.nan, np.float32)}, "mean"),
        ({"precision": np.full((4, 6, 1), np.inf, np.float32)}, "precision"),
        ({"mean": np.zeros((6, 4, 1), np.float32)}, "mean"),
        ({"place_m": np.array([0.0, np.nan, 0.0])}, "place_m"),
        ({"place_m": np.array([0.0, 1.0])}, "place_m"),
    ],
)
def test_a_belief_that_is_none_is_refused_by_name(change, field):
    grid = Grid((4, 6, 1), 0.1)
    given = {
        "mean": np.zeros(grid.shape, np.float32),
        "precision": np.ones(grid.shape, np.float32),
        "place_m": np.zeros(3),
    } | change
    with pytest.raises(SettingError) as refused:
        around(grid, given["mean"], given["precision"], SIGMA_PRIOR, given["place_m"], 0.3)
    assert refused.value.field == field
