"""Poses to choose among: the order of a raster, by hand, and what is drawn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.strategies.next_best_view.pose_samples import (
    drawn_poses,
    next_of_raster,
    raster_rows,
    yaws_around,
)
from entropy_explore_env.frontiers.blocks import NONE


def test_a_raster_goes_row_by_row_and_takes_all_scans_of_a_place_first():
    """Every third place of a plan of 7 × 5, the first one in the middle of a step: x = 1, 4, y = 1, 4."""
    places = np.argwhere(np.ones((7, 5), bool))
    rows = places[raster_rows(places, 3, (7, 5))].tolist()
    assert rows == [[1, 1], [4, 1], [1, 4], [4, 4]]
    narrow = np.argwhere(np.ones((7, 1), bool))
    assert narrow[raster_rows(narrow, 3, (7, 1))].tolist() == [[1, 0], [4, 0]]
    taken: dict[int, int] = {}
    assert [next_of_raster(taken, [8, 5], 2) for _ in range(2)] == [8, 8]
    assert [next_of_raster(taken, [3, 8, 5], 2) for _ in range(2)] == [3, 3]
    assert next_of_raster(taken, [5, 3], 2) == 5
    assert next_of_raster(taken, [3], 2) == NONE  # the other scan of 5 waits until 5 can be reached again
    assert next_of_raster(taken, [3, 5], 2) == 5
    assert next_of_raster(taken, [3, 5, 8], 2) == NONE


def test_yaws_show_all_around_and_poses_lie_where_they_are_drawn():
    assert yaws_around(math.pi / 2) == pytest.approx([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi])
    assert yaws_around(2.0 * math.pi) == [0.0] and len(yaws_around(0.0)) == 63
    drawn, gazes = drawn_poses(np.random.default_rng(3), np.array([4, 9]), 500, (-0.3, 0.2))
    assert set(drawn) == {4, 9} and gazes.shape == (500, 2)
    assert np.abs(gazes[:, 0]).max() == pytest.approx(math.pi, abs=0.1)
    assert (gazes[:, 1].min(), gazes[:, 1].max()) == pytest.approx((-0.3, 0.2), abs=0.01)
