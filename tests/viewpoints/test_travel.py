"""Seconds of planned drives: a plan with one wall, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from entropy_explore_env.belief.paths.lattice import belief_costs, new_lattice
from entropy_explore_env.belief.paths.planning import ANY_GOAL, search_paths
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.viewpoints.evaluation import DriveModel
from entropy_explore_env.viewpoints.travel import travel_seconds

SIZE, EDGE_M = (9, 13, 1), 0.5
DRIVE = DriveModel(1.0, 1.0, math.pi / 2, 0.5, 0.0)


@pytest.fixture
def search():
    """A robot at (1.5, 1.5); a wall at x = 4 that is open at y = 12."""
    mean = np.zeros(SIZE, np.float32)
    mean[4, :12] = 1.0
    costs = belief_costs(mean, np.full(SIZE, 100.0, np.float32), 1e-3)
    found, lattice = new_search(mean.size), new_lattice(SIZE)
    source = np.array([np.ravel_multi_index((1, 1, 0), SIZE)], np.int32)
    search_paths(found, lattice, costs, source, ANY_GOAL, math.inf)
    return found


def seconds_of(search, viewpoints, reach=math.inf):
    here, seconds = np.array([1.5, 1.5, 0.5, 0.0, 0.0]), np.full(len(viewpoints), np.nan)
    travel_seconds(search, SIZE, DRIVE, EDGE_M, here, np.array(viewpoints, float), reach, seconds)
    return seconds


def test_seconds_are_those_of_the_longer_of_drive_and_turn_and_of_the_scan(search):
    stay, turn, ahead, wall = seconds_of(
        search,
        [
            (1.5, 1.5, 0.5, 0.0, 0.0),
            (1.5, 1.5, 0.5, -math.pi / 2, 0.0),
            (1.5, 9.5, 0.5, 0.0, 0.0),
            (4.5, 3.5, 0.5, 0.0, 0.0),
        ],
    )
    assert (stay, turn) == pytest.approx((0.5, 1.5))
    assert ahead == pytest.approx(4.0 + 1.0 + 0.5)  # 4 m at 1 m/s, and a second for the ramps
    assert math.isinf(wall)


def test_paths_around_corners_are_longer_than_the_straight_line(search):
    (around,) = seconds_of(search, [(6.5, 1.5, 0.5, 0.0, 0.0)])
    steps = 2 * (8 + 3 * math.sqrt(2.0)) + 2 - 1  # up to the gap and down again; corners are not cut
    assert 0.9 * steps * EDGE_M < around - 1.5 < 1.1 * steps * EDGE_M


def test_long_paths_take_hops_of_equal_length_with_a_scan_each(search):
    (hops,) = seconds_of(search, [(1.5, 9.5, 0.5, 0.0, 0.0)], reach=4.0)
    assert hops == pytest.approx(2 * (2.0 + 1.0 + 0.5))
