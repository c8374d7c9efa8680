"""Predictions in volumes against exact fractions and NumPy: layers, borders, voxels unlike cells."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.prediction.crop import UNPREDICTED, around
from entropy_explore_env.prediction.predictor import Predictor, shipped_predictor
from entropy_explore_env.prediction.volumes import (
    VOLUMES,
    VolumePredictor,
    pool_volume_crop,
    volume_window,
)
from entropy_explore_env.prediction.weights import features_of, read_network
from entropy_explore_env.settings.grid import Grid
from tests.prediction.networks import file_bytes, random_tensors, written
from tests.prediction.test_crop import SIGMA_PRIOR, drawn_belief
from tests.reference import prediction as reference

GRIDS = [
    ((19, 33, 9), Fraction(2, 5), (4.0, -3.0, 1.0)),
    ((31, 23, 10), Fraction(1, 4), (0.0, 0.0, 0.0)),
    ((11, 7, 45), Fraction(1, 2), (-1.0, 2.0, -3.0)),
    ((70, 5, 3), Fraction(1, 1), (0.0, 0.0, 0.0)),
]


def in_the_middle(grid: Grid) -> np.ndarray:
    return np.asarray(grid.origin_m) + np.array([0.4, 0.9, 0.7]) * grid.size_m


@pytest.mark.parametrize(("shape", "voxel", "origin_m"), GRIDS)
def test_cells_are_those_of_exact_fractions(shape, voxel, origin_m):
    grid = Grid(shape, float(voxel), origin_m)
    mean, precision, measured = drawn_belief(shape, 3)
    there = around(grid, mean, precision, SIGMA_PRIOR, in_the_middle(grid), 0.0)
    cells, window = pool_volume_crop(there)
    first = reference.window(in_the_middle(grid), np.asarray(origin_m), 2 * reference.CELL, 64)
    assert (window.x, window.y) == first
    expected, unknown = reference.volume_channels(mean, measured, voxel, window)
    np.testing.assert_allclose(cells, expected, rtol=1e-6)
    assert unknown.any() and (expected[:64] > 0.0).any() and expected[64].any()


@pytest.mark.parametrize(
    ("shape", "edge_m", "height_m", "first"),
    [
        ((80, 60, 25), 0.4, 9.9, 0),  # no taller than a crop
        ((80, 60, 100), 0.4, 3.0, 0),
        ((80, 60, 100), 0.4, 20.0, 32),  # 50 cells up, from a multiple of 16 on
        ((80, 60, 100), 0.4, 39.0, 68),  # at the top
        ((80, 60, 65), 0.25, 16.0, 9),  # 41 cells in all
    ],
)
def test_layers_begin_at_the_floor_or_around_the_robot(shape, edge_m, height_m, first):
    grid = Grid(shape, edge_m)
    belief = drawn_belief(shape, 1)[:2]
    there = around(grid, *belief, SIGMA_PRIOR, np.array([5.0, 5.0, height_m]), 0.0)
    window = volume_window(there.belief, there.place)
    assert window[2] == first and window[0] % 16 == window[1] % 16 == 0


@pytest.fixture(scope="module")
def predictor(tmp_path_factory) -> VolumePredictor:
    content = file_bytes(random_tensors(form=VOLUMES), features_of(VOLUMES))
    return VolumePredictor(read_network(written(tmp_path_factory.mktemp("v") / "w", content), VOLUMES))


@pytest.mark.parametrize(("shape", "voxel", "origin_m"), GRIDS)
def test_voxels_are_predicted_by_the_cell_of_their_centre(predictor, shape, voxel, origin_m):
    """Nothing is said of a voxel in whose cell another one was measured, nor of one outside of the crop."""
    grid = Grid(shape, float(voxel), origin_m)
    mean, precision, measured = drawn_belief(shape, 5)
    there = around(grid, mean, precision, SIGMA_PRIOR, in_the_middle(grid), 0.0)
    first = volume_window(there.belief, there.place)
    cells, unknown = reference.volume_channels(mean, measured, voxel, first)
    solid = 1.0 / (1.0 + np.exp(-reference.logits(random_tensors(form=VOLUMES), cells)))
    found = predictor.predict(grid, mean, precision, SIGMA_PRIOR, in_the_middle(grid), 0.0)
    expected = np.full(shape, UNPREDICTED)
    for at in np.ndindex(*shape):
        i, j, k = (
            int((n + Fraction(1, 2)) * voxel / Fraction(2, 5)) - begin
            for n, begin in zip(at, first, strict=True)
        )
        if 0 <= i < 64 and 0 <= j < 64 and 0 <= k < 32 and unknown[k, i, j]:
            expected[at] = solid[k, i, j]
    np.testing.assert_allclose(found, expected, atol=2e-4)
    assert (expected >= 0.0).any() and not (found[measured] >= 0.0).any()
    with pytest.raises(ValueError, match="read-only"):
        found[0, 0, 0] = 0.0


def test_memory_of_earlier_crops_changes_no_bit(predictor):
    grid = Grid((40, 30, 12), 0.4)
    beliefs = [drawn_belief(grid.shape, seed)[:2] for seed in (1, 2, 1)]
    place_m = np.array([8.0, 6.0, 2.0])
    found = [predictor.predict(grid, *each, SIGMA_PRIOR, place_m, 0.0) for each in beliefs]
    assert np.array_equal(found[0], found[2]) and not np.array_equal(found[0], found[1])


def test_numbers_out_of_range_are_refused(predictor):
    grid = Grid((8, 7, 6), 0.4)
    mean, precision, _ = drawn_belief(grid.shape, 1)
    for sigma_prior in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(SettingError, match="sigma_prior"):
            predictor.predict(grid, mean, precision, sigma_prior, np.ones(3), 0.0)
    with pytest.raises(SettingError, match="place_m"):
        predictor.predict(grid, mean, precision, SIGMA_PRIOR, np.full(3, 1e300), 0.0)
    mean[3, 2, 1] = np.nan
    with pytest.raises(SettingError, match="mean"):
        predictor.predict(grid, mean, precision, SIGMA_PRIOR, np.ones(3), 0.0)


def test_plans_and_networks_of_plans_are_refused(predictor):
    grid = Grid((8, 7, 1), 0.4)
    with pytest.raises(SettingError, match="several layers of voxels"):
        predictor.predict(grid, *drawn_belief(grid.shape, 1)[:2], SIGMA_PRIOR, np.ones(3), 0.0)
    with pytest.raises(SettingError, match=r"first\.0 .* networks for crops of 32 layers"):
        VolumePredictor(shipped_predictor().network)
    with pytest.raises(SettingError, match=r"first\.0 .* networks for crops of 1 layer"):
        Predictor(predictor.network)
    head = predictor.network.head
    for wrong in (head._replace(bias=head.bias[:1]), head._replace(weights=head.weights.astype(float))):
        with pytest.raises(SettingError, match="head"):
            VolumePredictor(predictor.network._replace(head=wrong))
