"""Predictions: what is measured wins, they stay where robots move on, small maps are padded, bits repeat."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

from entropy_explore_env.prediction.predictor import Predictor, read_predictor
from entropy_explore_env.settings.grid import Grid
from tests.prediction.networks import file_bytes, random_tensors, written
from tests.prediction.test_crop import SIGMA_PRIOR, drawn_belief
from tests.reference import prediction as reference


@pytest.fixture(scope="module")
def predictor(tmp_path_factory) -> Predictor:
    file = written(tmp_path_factory.mktemp("predictor") / "w.safetensors", file_bytes(random_tensors()))
    return read_predictor(file)


def test_a_prediction_is_that_of_the_references(predictor):
    grid = Grid((190, 230, 1), 0.1, (-3.0, 5.0, 0.0))
    mean, precision, measured = drawn_belief(grid.shape, 8)
    place_m = np.array([4.0, 20.0, 0.05, 1.0, 0.0])
    found = predictor.predict(grid, mean, precision, SIGMA_PRIOR, place_m, 0.3)
    first = reference.window(place_m, np.array(grid.origin_m))
    assert found.origin_m == pytest.approx(grid.origin_m[:2] + 0.2 * np.array(first))
    assert found.cell_m == 0.2 and found.layers == (0, 1)
    cells, solid = reference.channels(mean, measured, Fraction(1, 10), first, range(1))
    expected = 1.0 / (1.0 + np.exp(-reference.logits(random_tensors(), cells)[0]))
    assert np.array_equal(found.measured, cells[:2].max(axis=0) > 0)
    np.testing.assert_allclose(found.solid, np.where(solid < 0.0, expected, solid), atol=2e-4)
    assert 0.1 < found.measured.mean() < 0.9


def test_cells_of_places(predictor):
    grid = Grid((60, 40, 1), 0.25, (1.0, -2.0, 0.0))
    belief = drawn_belief(grid.shape, 2)[:2]
    found = predictor.predict(grid, *belief, SIGMA_PRIOR, np.array([9.0, 3.0, 0.1]), 0.3)
    cell = found.cell_of(np.array([9.0, 3.0, 0.1]))
    low = found.origin_m + 0.2 * np.array(cell)
    assert (low <= [9.0, 3.0]).all() and (low + 0.2 > [9.0, 3.0]).all()
    assert all(56 <= at < 72 for at in cell)
    assert "128 × 128 cells of 0.2 m" in repr(found)
    with pytest.raises(ValueError, match="read-only"):
        found.solid[0, 0] = 0.0


def test_a_map_smaller_than_the_crop_is_outside_all_around(predictor):
    grid = Grid((7, 11, 5), 0.25)
    belief = drawn_belief(grid.shape, 2)[:2]
    found = predictor.predict(grid, *belief, SIGMA_PRIOR, np.array([0.5, 0.5, 0.6]), 0.2)
    assert found.layers == (1, 4)
    x, y = np.rint((np.zeros(2) - found.origin_m) / 0.2).astype(int)
    outside = np.ones((128, 128), bool)
    outside[x : x + 9, y : y + 14] = False  # 1.75 × 2.75 m
    assert (found.solid[outside] == 1.0).all() and not found.measured[outside].any()
    asked = ~outside & ~found.measured
    assert asked.any() and (found.solid[asked] > 0.0).all() and (found.solid[asked] < 1.0).all()


def test_a_prediction_does_not_depend_on_where_within_16_cells_a_robot_is(predictor):
    grid = Grid((200, 150, 1), 0.1)
    belief = drawn_belief(grid.shape, 6)[:2]
    places = [np.array([8.1 + dx, 8.1 + dy, 0.0]) for dx, dy in ((0, 0), (3.0, 0.0), (1.3, 2.9), (3.3, 0.0))]
    found = [predictor.predict(grid, *belief, SIGMA_PRIOR, place, 0.3) for place in places]
    for other in found[1:3]:
        assert np.array_equal(found[0].origin_m, other.origin_m)
        assert np.array_equal(found[0].solid, other.solid)
    assert not np.array_equal(found[0].origin_m, found[3].origin_m)


def test_another_process_predicts_the_same_bits(predictor, tmp_path):
    file = written(tmp_path / "w.safetensors", file_bytes(random_tensors()))
    program = f"""
import hashlib
from pathlib import Path
from entropy_explore_env.prediction.predictor import read_predictor
from entropy_explore_env.settings.grid import Grid
from tests.prediction.test_predictor import digest_of
print(digest_of(read_predictor(Path({str(file)!r}))))
"""
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout.split()[-1] == digest_of(predictor)


def digest_of(predictor: Predictor) -> str:
    """Digest of a prediction in a belief that is always the same."""
    grid = Grid((90, 140, 1), 0.1)
    belief = drawn_belief(grid.shape, 4)[:2]
    found = predictor.predict(grid, *belief, SIGMA_PRIOR, np.array([4.0, 9.0, 0.0]), 0.3)
    return hashlib.sha256(found.solid.tobytes()).hexdigest()
