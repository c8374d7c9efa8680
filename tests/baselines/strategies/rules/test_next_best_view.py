"""Next best views: what is chosen and learned, the weight of the localization error, refusals."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from baselines.strategies.rules import next_best_view
from baselines.strategies.rules.next_best_view import NextBestView
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import find_scenario
from tests.baselines.strategies.rules.scenes import missions_of, play
from tests.reference import sujan
from tests.reference.scenes import started, toward

PRIOR = 30.0**-2


def test_what_should_have_been_seen_and_was_not_loses_interest():
    """A cell announced as visible that stays unknown keeps e^-β of the interest in it, each time."""
    missions = missions_of(robot={"reach_m": math.inf})
    strategy = NextBestView()
    play(missions, strategy, 2)
    expectations, view = strategy._expectations[0], view_of(missions, 0, 0)
    unknown = np.flatnonzero(view.precision.ravel() <= np.float32(PRIOR))[:5].astype(np.int32)
    known = np.flatnonzero(view.precision.ravel() > np.float32(PRIOR))[:3].astype(np.int32)
    expectations.visible = np.concatenate([unknown, known])
    before = expectations.interest.copy()
    strategy.choose(view)
    assert expectations.interest[unknown] == pytest.approx(sujan.interest(before[unknown], 1.0, 1.0))
    np.testing.assert_array_equal(expectations.interest[known], before[known])


def test_a_goal_holds_until_the_drive_there_has_ended():
    """A robot under way in its goal's voxel has not looked from there as it meant to."""
    missions, strategy = missions_of(robot={"reach_m": math.inf}), NextBestView()
    (_, goal) = play(missions, strategy, 2)[1]
    view = view_of(missions, 0, 0)
    passing = dataclasses.replace(view, move_end=MoveEnd.UNDER_WAY, under_way=True)
    np.testing.assert_array_equal(strategy.choose(passing), goal)
    assert (strategy.choose(view) != goal).any()


def test_settings_out_of_range_are_named():
    for bad in (-0.1, math.nan):
        with pytest.raises(SettingError, match="error_weight"):
            NextBestView(bad)


def hall(**settings):
    plan = {"grid": Grid((25, 21, 1), 0.5), "world": "empty"}
    sensor = {"field_of_view_rad": (math.pi / 3, 0.0), "angular_step_rad": math.pi / 24, "max_range_m": 4.0}
    return with_settings(find_scenario("occlusions"), {**plan, "sensor": sensor, **settings})


def drifting_mission(error_weight, drift=0.05):
    """How unsure of its pose a robot is over 16 decisions in a hall with two landmarks, and its choices."""
    task = hall(
        robot={"localization": {"xy_m_per_sqrt_m": drift, "yaw_rad_per_sqrt_m": 0.2 * drift}},
        fiducials={"positions_m": ((0.6, 5.0, 0.25), (12.0, 5.0, 0.25))},
    )
    missions, unsure, chosen = started(task, 3), 0.0, []
    strategy = NextBestView(error_weight)
    strategy.reset(task, np.random.default_rng(4))
    for _ in range(16):
        view = view_of(missions, 0, 0)
        chosen.append(strategy.choose(view))
        toward(missions, chosen[-1])
        unsure += float(np.trace(view_of(missions, 0, 0).covariance))
    return unsure, chosen


def test_who_weighs_the_localization_error_knows_its_pose_better(monkeypatch):
    monkeypatch.setattr(next_best_view, "_DISTANCE_WEIGHT", 0.0)
    careless, careful = drifting_mission(0.0)[0], drifting_mission(50.0)[0]
    assert 0.0 < careful < 0.7 * careless


def test_exact_robots_have_no_localization_error():
    chosen = [drifting_mission(weight, drift=0.0)[1] for weight in (0.0, 50.0)]
    assert (np.array(chosen[0]) == np.array(chosen[1])).all()


def test_who_is_stopped_by_a_teammate_of_whom_it_never_heard_goes_on():
    task = hall(robots=2, channel={"burst": 0, "announcements": False})
    missions, strategy = started(task, 3), NextBestView()
    strategy.reset(task, np.random.default_rng(4))
    toward(missions, *[strategy.choose(view_of(missions, 0, robot)) for robot in range(2)])
    view = view_of(missions, 0, 0)
    assert all(seen.heard_s < 0.0 for seen in view.teammates.values())
    stopped = dataclasses.replace(view, move_end=MoveEnd.TEAMMATE)
    for _ in range(4):
        chosen = strategy.choose(stopped)
        assert np.isfinite(chosen).all() and np.linalg.norm(chosen[:3] - view.pose[:3]) > 0.0
