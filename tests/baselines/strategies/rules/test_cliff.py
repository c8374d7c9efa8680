"""Rovers that map a cliff: they do not fall, they learn where nothing answers, and teams map on."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import CLIFF_STRATEGIES, make_strategy
from baselines.strategies.rules.cliff import CliffNextBestView
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import CLIFF, LAB
from tests.reference import sujan

QUICK = {"sensor": {"angular_step_rad": math.pi / 60}, "robot": {"reach_m": math.inf}}


def mapped(strategy, seed, scans):
    """(ends of drives, missions, the strategy) after a number of scans."""
    env = scripted_env(with_settings(CLIFF, {**QUICK, "max_cycles": scans}))
    ends: list[MoveEnd] = []

    def note(env):
        ends.append(list(MoveEnd)[env.missions.state.robots[0, 0]["move_end"]])

    run_mission(env, strategy, seed, note)
    return ends, env.missions, strategy


@pytest.mark.parametrize("name", CLIFF_STRATEGIES)
def test_no_rover_drives_over_the_edge(name):
    places = set()
    for seed in range(3):
        ends, missions, _ = mapped(make_strategy(name), seed, 16)
        assert set(ends) == {MoveEnd.ARRIVED} and missions.state.robots[0, 0]["scans"] >= 16
        places.add(float(missions.state.robots[0, 0]["distance_m"]) > 0.5)
    assert True in places


def test_a_goal_that_cannot_be_reached_is_given_up_and_teams_map_on():
    env = scripted_env(with_settings(CLIFF, {**QUICK, "robots": 2, "max_cycles": 24}))
    made, ends = CliffNextBestView(), set()

    def note(env):
        ends.update(list(MoveEnd)[end] for end in env.missions.state.robots[0]["move_end"])

    run_mission(env, made, 2, note)
    assert MoveEnd.EDGE not in ends and (env.missions.state.robots[0]["distance_m"] > 1.0).all()
    view, rover = view_of(env.missions, 0, 0), made._rovers[0]
    for end in (MoveEnd.TEAMMATE, MoveEnd.EDGE):
        goal = rover.goal = view.pose + np.array([1.0, 0.0, 0.0, 0.0, 0.0])
        looks = len(rover.ground.looks)
        made.choose(dataclasses.replace(view, move_end=end))
        assert rover.goal is not goal and len(rover.ground.looks) == looks + 1


def test_interest_falls_where_nothing_answers_and_nowhere_else():
    _, missions, strategy = mapped(CliffNextBestView(interest_decay=0.7), 0, 16)
    view, ground = view_of(missions, 0, 0), strategy.ground_of(0)
    ground.update(view, strategy.edge)
    now, before = ground.known, ground.interest.copy()
    assert len(ground.looks) > 5 and sum(look.obtained for look in ground.looks) > 500
    visibility = np.linspace(0.0, 1.0, 120 * 96).reshape(120, 96)
    answered = np.zeros((120, 96), bool)
    answered[30:40, 50:] = True
    ground._visibility = visibility
    ground.learn(now._replace(measurements=now.measurements - answered), 0.7)
    expected = [sujan.interest(b, p, 0.7) for b, p in zip(before.ravel(), visibility.ravel(), strict=True)]
    np.testing.assert_allclose(ground.interest, np.where(answered, before, np.reshape(expected, (120, 96))))
    _, _, steady = mapped(CliffNextBestView(interest_decay=0.0), 0, 8)
    assert (steady.ground_of(0).interest == 1.0).all()


def test_others_than_rovers_and_settings_out_of_range_are_refused():
    with pytest.raises(SettingError, match=r"above_ground_m and Robot\.tilts"):
        CliffNextBestView().reset(LAB, np.random.default_rng(0))
    with pytest.raises(SettingError):
        level = with_settings(CLIFF, {"robot": {"tilts": False}})
        CliffNextBestView().reset(level, np.random.default_rng(0))
    for bad in ({"edge": "circle"}, {"interest_decay": -1.0}, {"interest_decay": math.nan}):
        with pytest.raises(SettingError, match=f"{next(iter(bad))} ="):
            CliffNextBestView(**bad)


@pytest.mark.long
def test_the_recommended_strategy_learns_where_the_ground_ends():
    """No map shows the edge: it once drove against it 90 times in 200 s, and never came to the end."""
    env = scripted_env(CLIFF, ending={"time_limit_s": 400.0})
    run_mission(env, make_strategy("best"), seed=0)
    figures = mission_figures(env.missions, 0)
    assert figures["finished"] and figures["blocked_moves"] < 20
