"""Robots whose path a teammate blocks: they decide anew at once, or stand still first; and what they send."""

import math

import numpy as np
import pytest

from entropy_explore_env.missions.poses import pose_at
from entropy_explore_env.robots.motion import MoveEnd
from tests.reference import rocha04
from tests.reference.scenes import build, free_box, standing, started, toward, wander

HERE, FAR, STAY = (1.75, 2.75, 1.25, 0.0, 0.0), (1.75, 3.7, 1.25, 0.0, 0.0), (1.75, 3.75, 1.25, 0.0, 0.0)
WAITS = {"when_blocked": "wait", "blocked_wait_s": 2.0, "turn_rate_rad_s": math.inf, "body_radius_m": 0.25}


def behind_a_teammate(**changes):
    """Robot 0 is about to be stopped after half a metre, by robot 1: 2 s, and 0.5 s for the scan."""
    return standing(HERE, STAY, robot={**WAITS, **changes.pop("robot", {})}, **changes)


def test_a_robot_behind_a_teammate_scans_waits_and_then_decides():
    """0.5 m at 0.5 m/s²: 2 s; the scan until 2.5 s; the wait until 4.5 s."""
    missions = behind_a_teammate()
    times, deciding, scans = [], [], []
    for _ in range(9):
        robots = toward(missions, FAR, STAY)
        times.append(missions.state.missions[0]["time_s"])
        deciding.append(robots["deciding"].tolist())
        scans.append(int(robots["scans"][0]))
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.TEAMMATE
    assert times == pytest.approx([0.5 * n for n in range(1, 10)], abs=1e-5)  # robot 1 turns on the spot
    assert [who[0] for who in deciding] == [False] * 8 + [True]
    assert scans == [0, 0, 0, 0, 1, 1, 1, 1, 1]  # at 2.5 s, and no second one
    assert (robots["waiting"].tolist(), robots["blocked_moves"][0]) == ([True, False], 1)
    for time_s in (2.6, 3.0, 4.4, 4.5):
        place = pose_at(missions.rules.params[0], robots[0], time_s)
        assert place == pytest.approx((1.75, 3.25, 1.25, 0.0, 0.0), abs=1e-5)
    robots = toward(missions, HERE, STAY)
    assert not robots["waiting"][0]


def test_nothing_else_ends_a_wait():
    """The teammate leaves as soon as the robot has scanned; the step lasts until somebody decides."""
    missions = behind_a_teammate()
    for _ in range(5):
        toward(missions, FAR, STAY)
    toward(missions, FAR, (1.75, 4.7, 1.25, 0.0, 0.0))  # 0.95 m: 1 + 0.9 + 1 s and the scan
    assert missions.state.missions[0]["time_s"] == pytest.approx(4.5, abs=1e-5)
    robots = toward(missions, FAR, STAY)
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.ARRIVED


def test_a_wall_is_nothing_to_wait_for_and_who_wanders_waits_for_nobody():
    missions = behind_a_teammate()
    solid = np.zeros((7, 11, 5), bool)
    solid[3, 3, 2] = True
    build(missions, solid)
    robots = toward(missions, (1.75, 1.8, 1.25, 0.0, 0.0), STAY)
    for _ in range(5):
        robots = toward(missions, HERE, STAY)
        if robots["deciding"][0]:
            break
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.OBSTACLE and not robots["waiting"].any()
    missions = behind_a_teammate(robot={"when_blocked": "wander"})
    for _ in range(5):
        robots = toward(missions, FAR, STAY)
    assert (robots["deciding"][0], robots["blocked_moves"][0]) == (True, 1)
    assert missions.state.missions[0]["time_s"] == pytest.approx(2.5, abs=1e-5)
    assert not robots["waiting"].any()


def test_where_nobody_is_in_the_way_waiting_changes_nothing():
    """The same to the bit, but for what the setting itself says."""
    robot = {"body_radius_m": 0.0}
    teams = [
        started(free_box(robots=3, robot={**robot, "when_blocked": what}), seed=4)
        for what in ("wander", "wait")
    ]
    for missions in teams:
        wander(missions, 40, 7)
    assert teams[0].state.robots["blocked_moves"].sum() > 0  # by walls
    for one, two in zip(teams[0].state, teams[1].state, strict=True):
        assert one.tobytes() == two.tobytes()


def test_a_steered_i_min_goes_with_each_robot_s_own_scans():
    """What is sent follows from the reference: the selection with I_min, which the scan then moves."""
    channel = {"burst": 6, "i_min_bits": 2.0, "i_min_fill": 0.5}
    missions = started(free_box(robots=2, channel=channel), seed=3)
    i_min, sent, scans = [2.0, 2.0], [0, 0], [0, 0]
    rng = np.random.default_rng(1)
    for _ in range(60):
        missions.step(rng.uniform(-1, 1, (1, 2, 5)), np.zeros((1, 2), np.int64))
        robots = missions.state.robots[0]
        for a in range(2):
            if robots[a]["scans"] == scans[a]:
                continue
            scans[a] += 1
            measured = missions.state.scan_returned[0, a] != 0
            utility = np.where(measured, missions.state.scan_utility_bits[0, a], -1.0).tolist()
            sent[a] += len(rocha04.select(utility, 6, i_min[a]))
            assert robots[a]["i_min_bits"] == pytest.approx(i_min[a], rel=1e-9)
            i_min[a] = rocha04.steered(i_min[a], utility, 6, 0.5, 0.1)
            assert robots[a]["next_i_min_bits"] == pytest.approx(i_min[a], rel=1e-9)
    assert robots["measurements_sent"].tolist() == sent
    assert min(scans) > 10 and i_min[0] != i_min[1]
