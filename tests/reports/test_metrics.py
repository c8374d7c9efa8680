"""Figures of a mission against the arrays that they are read from."""

import json
import math

import numpy as np
import pytest

from entropy_explore_env.missions.records import COUNTED, MissionEnd
from entropy_explore_env.reports.metrics import information_floor, joint_figures, mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import ROOM
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


def test_counts_are_sums_and_stand_beside_each_robot_s_own_and_entropy_is_the_best_robot_s():
    missions = filled()
    first, second = (mission_figures(missions, mission) for mission in range(2))
    assert {name: second[name] for name in SUMS} == {
        name: 300 * COUNTED.index(count) + 321 for name, count in SUMS.items()
    }
    assert not any(first[name] for name in SUMS)
    assert second["per_robot"] == [
        {name: robot[name] for name in COUNTED} for robot in missions.state.robots[1]
    ]
    assert (second["entropy_end_bits"], second["t_mission_s"]) == (256.5, 87.5)
    assert (second["entropy_start_bits"], second["entropy_threshold_bits"]) == (2000.0, -300.0)


@pytest.mark.parametrize("end", MissionEnd)
def test_a_mission_is_finished_only_if_it_was_mapped_or_seen(end):
    missions = filled()
    missions.state.missions[1]["end"] = end.code
    figures = mission_figures(missions, 1)
    finished = end in (MissionEnd.MAPPED, MissionEnd.SEEN)
    assert (figures["finished"], figures["end_reason"]) == (finished, end.name)


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
    maybe = {name for name, value in figures.items() if value is None}
    assert maybe <= {"t50_s", "t90_s", "t99_s", "scans_over_floor"}
    assert all(kinds[name] is float for name in kinds if name.endswith(("_bits", "_s")) and name not in maybe)
    assert kinds["finished"] is bool and kinds["seed"] is int
    robots = missions.state.robots[0]
    for figure, count in SUMS.items():
        assert figures[figure] == pytest.approx(np.sum(robots[count]))
    assert figures["scans"] > 20 and figures["shared_measurements"] > 0


def test_shares_and_spreads_by_hand():
    missions = filled()
    robots, clock = missions.state.robots[1], missions.state.missions[1]
    robots["measurements"], robots["redundant"] = [100, 200, 300], [10, 20, 30]
    robots["bits_sent"], robots["heard_bits"] = [1000, 0, 1000], [100.0, 200.0, 300.0]
    robots["gained_bits"] = [1.0, 2.0, 3.0]
    clock["reached_s"] = [3.5, 7.0, -1.0, -1.0]
    figures = mission_figures(missions, 1)
    assert (figures["overlap"], figures["bits_gained_per_bit_sent"]) == (0.1, 0.3)
    assert figures["balance"] == pytest.approx(np.sqrt(2 / 3) / 2)
    assert (figures["t50_s"], figures["t90_s"], figures["t99_s"]) == (3.5, 7.0, None)
    assert figures["entropy_mean_bits"] == pytest.approx((512.25 + 256.5 + 1024.0) / 3)
    assert "joint" not in figures and figures["scans_over_floor"] is None


def test_what_cannot_be_said_is_none():
    figures = mission_figures(started(free_box(robots=1)), 0)
    for name in ("overlap", "bits_gained_per_bit_sent", "balance", "t50_s"):
        assert figures[name] is None


def test_joint_figures_by_hand():
    missions = started(free_box(track_truth=True), seed=1)
    clock = missions.state.missions[0]
    assert joint_figures(missions, 0)["error"] is joint_figures(missions, 0)["wrong"] is None
    clock["joint_bits"], clock["explored"], clock["explored_visible"] = -7.5, 40, 30
    clock["error"], clock["wrong"] = 2.0, 10
    visible = missions.state.visible[0].sum()
    assert visible == 385
    expected = {"entropy_bits": -7.5, "explored": 30 / 385, "error": 0.05, "wrong": 0.25}
    clock["explored_free"], clock["seen_s"][:2], clock["seen_m"][:2] = 25, (3.0, 4.5), (0.0, 1.25)
    marks = {"t50_seen_s": 3.0, "path50_seen_m": 0.0, "t90_seen_s": 4.5, "path90_seen_m": 1.25}
    unseen = {
        f"{name}{mark}_seen_{unit}": None
        for name, unit in (("t", "s"), ("path", "m"))
        for mark in (95, 99, 100)
    }
    free = {"unseen_free_voxels": 385 - 25, "driven_m": 0.0}
    assert mission_figures(missions, 0)["joint"] == {**expected, **free, **marks, **unseen}


def test_the_floor_of_the_paper_s_room():
    """About 80 scans, 76 to 97 by how far rays reach: 28,577 voxels of 1/0.03² over what a scan brings."""
    missions = started(ROOM)
    floor = information_floor(ROOM, missions.worlds[0])
    assert 70.0 < floor < 100.0
    missions.state.robots[0]["scans"] = [100, 50, 10]
    assert mission_figures(missions, 0, floor=True)["scans_over_floor"] == pytest.approx(160 / floor)
    halved = with_settings(ROOM, {"ending": {"sigma_end": 0.03 * np.sqrt(2)}})
    assert information_floor(halved, missions.worlds[0]) == pytest.approx(floor / 2, rel=1e-4)


def test_a_sensor_that_is_blind_everywhere_has_no_floor():
    """The box is 6.98 m across. This divided by zero."""
    missions = started(free_box(sensor={"min_range_m": 6.99}, track_truth=True))
    wander(missions, 3, 0)
    figures = mission_figures(missions, 0)
    assert missions.worlds[0] is not None
    assert information_floor(missions.scenario, missions.worlds[0]) == math.inf
    assert figures["scans_over_floor"] is None and figures["scans"] > 0
