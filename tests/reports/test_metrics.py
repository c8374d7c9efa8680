"""Figures of a mission against the arrays that they are read from."""

from __future__ import annotations

import json

import numpy as np
import pytest

from entropy_explore_env.missions.state import COUNTED, MissionEnd
from entropy_explore_env.reports.metrics import mission_figures
from tests.reference.scenes import free_box, started, wander

SUMS = {
    "scans": "scans",
    "measurements": "measurements",
    "shared_measurements": "measurements_sent",
    "bits_sent": "bits_sent",
    "bits_received": "bits_received",
    "messages_lost": "messages_lost",
    "distance_m": "distance_m",
    "blocked_moves": "blocked_moves",
}
"""Figure → the robots' count that it adds up."""


def filled():
    """Two missions of three robots; in the second every count is another number."""
    missions = started(free_box(robots=3), seed=40, missions=2)
    robots, clock = missions.state.robots[1], missions.state.missions[1]
    for number, name in enumerate(COUNTED):
        robots[name] = [100 * number + 1, 100 * number + 20, 100 * number + 300]
    robots["entropy_bits"] = [512.25, 256.5, 1024.0]
    clock["time_s"], clock["entropy_start_bits"], clock["entropy_end_bits"] = 87.5, 2000.0, -300.0
    return missions


@pytest.mark.parametrize(("figure", "count"), SUMS.items())
def test_counts_are_sums_over_the_team(figure, count):
    missions = filled()
    number = COUNTED.index(count)
    assert mission_figures(missions, 1)[figure] == 300 * number + 321
    assert mission_figures(missions, 0)[figure] == 0


def test_entropy_is_that_of_the_best_informed_robot():
    figures = mission_figures(filled(), 1)
    assert figures["entropy_end_bits"] == 256.5
    assert (figures["entropy_start_bits"], figures["entropy_threshold_bits"]) == (2000.0, -300.0)
    assert figures["t_mission_s"] == 87.5


def test_each_robot_s_own_counts_stand_beside_the_sums():
    missions = filled()
    own = mission_figures(missions, 1)["per_robot"]
    assert [list(robot) for robot in own] == [list(COUNTED)] * 3
    for robot, counts in enumerate(own):
        assert counts == {name: missions.state.robots[1, robot][name] for name in COUNTED}


@pytest.mark.parametrize("end", MissionEnd)
def test_a_mission_is_finished_only_if_it_was_mapped(end):
    missions = filled()
    missions.state.missions[1]["end"] = end.code
    figures = mission_figures(missions, 1)
    assert (figures["finished"], figures["end_reason"]) == (end is MissionEnd.MAPPED, end.name)


def test_figures_say_which_mission_it_was():
    missions = started(free_box(robots=3, world="furnished"), seed=40, missions=2)
    for mission in (0, 1):
        figures = mission_figures(missions, mission)
        named = [figures[name] for name in ("scenario", "world", "robots", "seed")]
        assert named == ["box-7x11x5", "furnished", 3, 40 + mission]


def test_figures_of_a_real_mission_are_plain_numbers_of_json():
    missions = started(free_box(robots=2), seed=3)
    wander(missions, 40, 0)
    figures = mission_figures(missions, 0)
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    kinds = {name: type(value) for name, value in figures.items()}
    assert all(kinds[name] is (float if name == "distance_m" else int) for name in SUMS)
    assert all(kinds[name] is float for name in kinds if name.endswith(("_bits", "_s")))
    assert kinds["finished"] is bool and kinds["seed"] is int
    robots = missions.state.robots[0]
    for figure, count in SUMS.items():
        assert figures[figure] == pytest.approx(np.sum(robots[count]))
    assert figures["scans"] > 20 and figures["shared_measurements"] > 0
