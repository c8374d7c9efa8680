"""Raster scanning: the lattice, row by row, and the gazes at each place."""

from __future__ import annotations

import math

import pytest

from baselines.strategies.rules.raster import Raster
from tests.baselines.strategies.rules.scenes import missions_of, play


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


def test_raster_of_a_fixed_yaw_looks_once_along_x_from_each_place():
    (_, first), (_, second) = play(missions_of(robot={"reach_m": math.inf}), Raster(turning=False), 3)[1:]
    assert first[3] == 0.0 and (first[:2] != second[:2]).any()
