"""Elevation maps read off beliefs, and completed as a dense solver of Laplace's equation completes them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_cdt

from entropy_explore_env.belief.elevation import completed, elevation_map
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.grid import Grid
from tests.reference.scenes import drawn, seeds
from tests.reference.sujan import neighbours_mean

SIZE = (7, 11, 5)
GRID = Grid(SIZE, 0.5, (1.0, 2.0, -3.0))
PRIOR = np.float32(30.0**-2)


def belief(changes):
    """Mean and precision of a belief of which some voxels were measured: (μ, how often at σ 0.1)."""
    mean, precision = np.full(SIZE, 0.5, np.float32), np.full(SIZE, PRIOR)
    for voxel, (coverage, times) in changes.items():
        mean[voxel] = coverage
        precision[voxel] += np.float32(times * 100.0)
    return mean, precision


def test_the_ground_is_the_highest_covered_voxel_by_hand():
    mean, precision = belief(
        {
            (2, 3, 4): (0.0, 9),  # free above
            (2, 3, 3): (0.75, 4),  # the ground: 3.75 voxels above the floor
            (2, 3, 2): (1.0, 2),
            (5, 9, 2): (1.0, 1),  # nothing measured above it: the ground, too
            (6, 0, 4): (0.0, 5),  # free at the top alone: not known
            (0, 10, 0): (0.1, 3),  # free down to the floor
            (3, 3, 1): (0.5, 7),  # neither covered nor lowest
        }
    )
    ground = elevation_map(mean, precision, GRID, 30.0, 0.1)
    assert set(zip(*np.nonzero(ground.known), strict=True)) == {(2, 3), (5, 9), (0, 10)}
    assert ground.height_m[2, 3] == pytest.approx(-3.0 + 0.5 * 3.75)
    assert ground.height_m[5, 9] == pytest.approx(-3.0 + 0.5 * 3.0)
    assert ground.height_m[0, 10] == -3.0 == ground.height_m[6, 0]
    assert ground.sigma_m[2, 3] == pytest.approx(0.5 * 0.1 / 2.0, rel=1e-4)
    assert ground.sigma_m[6, 0] == math.inf
    assert ground.measurements[[2, 5, 0, 6], [3, 9, 10, 0]] == pytest.approx([4, 1, 3, 0], rel=1e-5)


@drawn(60)
@given(st.tuples(st.integers(1, 23), st.integers(1, 17)), seeds, st.floats(0.02, 1.0))
def test_unknown_columns_are_completed_as_the_dense_system_says(shape, seed, share):
    rng = np.random.default_rng(seed)
    heights, known = rng.normal(0.0, 3.0, shape), rng.random(shape) < share
    known[rng.integers(shape[0]), rng.integers(shape[1])] = True
    found = completed(np.where(known, heights, np.nan), known, 1e-6)
    np.testing.assert_allclose(found, neighbours_mean(heights, known), atol=2e-5)
    np.testing.assert_array_equal(found[known], heights[known])
    again = completed(heights, known, 1e-6, rng.normal(0.0, 3.0, shape))
    np.testing.assert_allclose(again, found, atol=4e-5)
    assert found.min() >= heights[known].min() - 1e-5 and found.max() <= heights[known].max() + 1e-5


def test_a_wide_gap_is_bridged_in_a_straight_line():
    known = np.zeros((400, 3), bool)
    known[0] = known[-1] = True
    heights = np.zeros((400, 3))
    heights[-1] = 39.9
    expected = np.linspace(0.0, 39.9, 400)
    np.testing.assert_allclose(completed(heights, known), np.repeat(expected[:, None], 3, 1), atol=2e-4)


def test_nothing_known_is_level_and_all_known_stays():
    assert (completed(np.full((3, 4), np.nan), np.zeros((3, 4), bool)) == 0.0).all()
    heights = np.arange(12.0).reshape(3, 4)
    np.testing.assert_array_equal(completed(heights, np.ones((3, 4), bool)), heights)


def test_bad_input_is_named():
    mean, precision = belief({})
    with pytest.raises(SettingError, match=r"mean.*\(7, 11, 5\)"):
        elevation_map(mean[:3], precision, GRID, 30.0, 0.1)
    with pytest.raises(SettingError, match="more than one voxel high"):
        elevation_map(mean[:, :, :1], precision[:, :, :1], Grid((7, 11, 1), 0.5), 30.0, 0.1)
    with pytest.raises(SettingError, match=r"sigma_min.*> 0"):
        elevation_map(mean, precision, GRID, 30.0, 0.0)
    with pytest.raises(SettingError, match=r"known.*\(3, 4\) bool"):
        completed(np.zeros((3, 4)), np.zeros((3, 4)))
    with pytest.raises(SettingError, match="finite where it is known"):
        completed(np.full((3, 4), np.nan), np.ones((3, 4), bool))
    with pytest.raises(SettingError, match="tolerance_m"):
        completed(np.zeros((3, 4)), np.ones((3, 4), bool), -1.0)
    with pytest.raises(SettingError, match="begin_m"):
        completed(np.zeros((3, 4)), np.eye(3, 4, dtype=bool), 1.0, np.full((3, 4), np.nan))


def chessboard(heights, fixed, tolerance):
    """Over-relaxation in its plainest form: white squares, then black ones, until a sweep changes little."""
    gap = int(np.max(np.asarray(distance_transform_cdt(~fixed, "taxicab"))))
    slowest = 0.5 * (1.0 + math.cos(math.pi / (2 * gap + 1)))
    factor = 2.0 / (1.0 + math.sqrt(1.0 - slowest * slowest))
    padded, free = np.pad(heights, 1), np.pad(~fixed, 1)
    inside = np.pad(np.ones(heights.shape), 1)
    i, j = np.indices(padded.shape)
    sweeps, most = 0, math.inf
    while sweeps < 40 * (gap + 10) and most > (2.0 - factor) * tolerance:
        sweeps, most = sweeps + 1, 0.0
        for colour in (1, 0):
            squares = np.argwhere(free & ((i + j) % 2 == colour))
            x, y = squares.T
            beside = padded[x - 1, y] + padded[x + 1, y] + padded[x, y - 1] + padded[x, y + 1]
            number = inside[x - 1, y] + inside[x + 1, y] + inside[x, y - 1] + inside[x, y + 1]
            change = (factor / np.maximum(number, 1.0)) * beside - factor * padded[x, y]
            padded[x, y] += change
            most = max(most, np.abs(change).max(initial=0.0))
    return padded[1:-1, 1:-1], sweeps


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 11), (12, 5), (69, 41), (96, 8)])
def test_sweeps_that_go_over_the_rows_together_are_those_done_one_after_the_other(shape):
    """Bit for bit, whatever the number of sweeps that it takes."""
    rng, counts = np.random.default_rng(shape[0]), set()
    for tolerance in (0.3, 1e-2, 1e-4, 1e-300):  # the last uses its sweeps up
        for share in (0.03, 0.4, 1.0):
            heights, fixed = rng.random(shape), rng.random(shape) < share
            fixed.flat[rng.integers(fixed.size)] = True
            begin = rng.random(shape)
            expected, sweeps = chessboard(np.where(fixed, heights, begin), fixed, tolerance)
            np.testing.assert_array_equal(completed(heights, fixed, tolerance, begin), expected)
            counts.add(sweeps % 6)
    assert len(counts) > 1 or shape == (1, 1)
