"""Raster scanning: the lattice, row by row, and the gazes at each place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.strategies.rules.raster import Raster, RasterScan, raster_rows
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.missions.view import view_of
from tests.baselines.strategies.rules.scenes import missions_of, play


def test_a_raster_goes_row_by_row_by_hand():
    """Every third place of a plan of 7 × 5, the first one in the middle of a step: x = 1, 4, y = 1, 4."""
    places = np.argwhere(np.ones((7, 5), bool))
    assert places[raster_rows(places, 3, (7, 5))].tolist() == [[1, 1], [4, 1], [1, 4], [4, 4]]
    narrow = np.argwhere(np.ones((7, 1), bool))
    assert narrow[raster_rows(narrow, 3, (7, 1))].tolist() == [[1, 0], [4, 0]]


def test_a_raster_takes_all_scans_of_a_place_that_can_be_reached_first():
    """Two scans a place, to either side; places are the first voxels along y, all on the lattice."""
    missions = missions_of(sensor={"field_of_view_rad": (math.pi, 0.0)})
    view, scans = view_of(missions, 0, 0), RasterScan(turning=True)

    def taken(*voxels):
        return scans.next_scan(view, np.array(voxels, np.int32), 0.1)

    assert [taken(8, 5) for _ in range(2)] == [(5, 0.0), (5, pytest.approx(math.pi))]
    assert [taken(3, 8, 5)[0] for _ in range(2)] == [3, 3]
    assert taken(3, 5, 8)[0] == 8
    assert taken(3)[0] == NONE  # the other scan of 8 waits until 8 can be reached again
    assert taken(3, 8) == (8, pytest.approx(math.pi))
    assert taken(3, 5, 8)[0] == NONE


def test_raster_scans_a_lattice_row_by_row_in_all_directions():
    missions = missions_of(robot={"reach_m": math.inf}, sensor={"max_range_m": 10.0})
    chosen = play(missions, Raster(), 13)[1:]
    places = [tuple(viewpoint[:2]) for _, viewpoint in chosen]
    assert {round((x - 2.75) / 5.0, 9) % 1 for x, _ in places} == {
        0.0
    }  # 5 m apart, half of that from the edge
    assert [places[4 * n : 4 * n + 4] == [places[4 * n]] * 4 for n in range(3)] == [True] * 3
    yaws = [float(viewpoint[3]) for _, viewpoint in chosen[:4]]
    assert yaws == pytest.approx([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi])
