"""The strategies `mutual-information` and `ground-gradient`: what they heed, and what they do when stuck."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import STRATEGIES, make_strategy
from baselines.strategies.rules.mutual_information import MutualInformation
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import LAB
from tests.reference.scenes import free_box, put, started

PLANAR = {"motion": "planar", "sensor_height_m": 1.25, "reach_m": 2.0, "turn_rate_rad_s": math.inf}


def frontier(robots=2, **changes):
    """Robots in a box of which all know the middle, y from 1 to 4.5 m, and nothing beyond it."""
    missions = started(free_box(robots=robots, robot={**PLANAR, **changes.pop("robot", {})}, **changes))
    for robot in range(robots):
        mean, precision = missions.mean[0, robot], missions.precision[0, robot]
        mean[:, 2:9], precision[:, 2:9] = 0.05, 1e4
    put(missions, 0, (1.75, 2.75, 1.25, 0.0, 0.0))
    for robot in range(1, robots):
        put(missions, robot, (0.75, 2.75, 1.25, 0.0, 0.0))
    return missions


def chosen(missions, times=20, robot=0, heard=None, **settings):
    """(times, 5) what a robot chooses, each time with other chances."""
    found = []
    for seed in range(times):
        strategy = MutualInformation(**settings)
        strategy.reset(missions.scenario, np.random.default_rng(seed))
        missions.state.robots[0, robot]["depth_m"] = 2.0
        missions.state.robots[0, robot]["half_angle_rad"] = 0.5
        if heard is not None:
            heard(missions.state.heard[0, robot])
        found.append(strategy.choose(view_of(missions, 0, robot)))
    return np.array(found)


def hear(viewpoint, depth_m=2.0, half_angle_rad=0.8, sender=1, at_s=0.0):
    def tell(heard):
        heard[sender]["heard_s"] = heard[sender]["announced_s"] = at_s
        heard[sender]["pose"] = viewpoint
        heard[sender]["announced"] = [*viewpoint, depth_m, half_angle_rad]

    return tell


def test_a_robot_goes_to_a_frontier_and_looks_beyond_it():
    for viewpoint in chosen(frontier(1)):
        y = viewpoint[1]
        assert (0.5 <= y <= 1.5 and viewpoint[3] == pytest.approx(-math.pi / 2)) or (
            4.0 <= y <= 5.0 and viewpoint[3] == pytest.approx(math.pi / 2)
        )
        assert viewpoint[2] == 1.25 and viewpoint[4] == 0.0


def test_chance_takes_one_of_equal_voxels():
    ends = chosen(frontier(1))
    assert {bool(y > 2.75) for y in ends[:, 1]} == {True, False}
    assert len(np.unique(ends[:, 0])) > 3


def test_what_a_teammate_announced_to_see_is_left_to_it_unless_it_was_lost():
    looks_up = hear((0.75, 3.25, 1.25, math.pi / 2, 0.0))
    coordinated = chosen(frontier(), heard=looks_up)
    assert (coordinated[:, 1] < 2.75).all()
    lost = chosen(frontier(), heard=None)
    assert {bool(y > 2.75) for y in lost[:, 1]} == {True, False}
    alone = chosen(frontier(), heard=looks_up, coordinated=False)
    assert {bool(y > 2.75) for y in alone[:, 1]} == {True, False}
    np.testing.assert_array_equal(alone, lost)


def test_no_robot_goes_through_a_teammate_of_which_it_knows():
    in_the_way = hear((1.75, 3.5, 1.25, 0.0, 0.0), depth_m=0.0)
    for coordinated in (True, False):
        bodies = frontier(robot={"body_radius_m": 0.25})
        straight_up = chosen(bodies, 60, heard=in_the_way, coordinated=coordinated)
        ahead = (np.abs(straight_up[:, 0] - 1.75) < 0.3) & (straight_up[:, 1] > 3.5)
        assert ahead.any() != coordinated


def test_distance_costs():
    near, far = (
        np.linalg.norm(chosen(frontier(1), distance_cost=k)[:, :2] - (1.75, 2.75), axis=1) for k in (1.0, 0.0)
    )
    assert near.max() <= far.min() + 1e-9 < far.max()


def test_candidates_lie_within_the_mean_depth_but_for_a_floor():
    missions = frontier(1)
    missions.precision[0, 0][:] = np.random.default_rng(0).uniform(1e-3, 1.0, (7, 11, 5))
    away = np.linalg.norm(chosen(missions)[:, :2] - (1.75, 2.75), axis=1)
    assert 0.5 < away.max() <= 2.0 + 1e-6
    missions.state.robots[0, 0]["depth_m"] = 0.1
    strategy = MutualInformation()
    strategy.reset(missions.scenario, np.random.default_rng(0))
    viewpoint = strategy.choose(view_of(missions, 0, 0))
    assert 0.1 < np.linalg.norm(viewpoint[:2] - (1.75, 2.75)) <= 0.5 + 1e-6


def test_nobody_goes_through_or_into_what_is_believed_covered():
    missions = frontier(1)
    missions.mean[0, 0][:, 8] = 0.9
    assert (chosen(missions)[:, 1] < 2.75).all()


def test_where_nothing_is_steep_and_behind_a_teammate_it_wanders():
    missions = frontier(1)
    missions.precision[0, 0][:] = 1e4
    wild = chosen(missions)
    assert len(np.unique(wild[:, 3])) == 20 and np.ptp(wild[:, 1]) > 1.0
    for what, wanders in (("wander", True), ("wait", False)):
        missions = frontier(robot={"when_blocked": what})
        missions.state.robots[0, 0]["move_end"] = 5  # TEAMMATE
        gazes = np.unique(np.abs(chosen(missions)[:, 3]))
        assert (len(gazes) == 20) == wanders


def test_a_viewpoint_chosen_too_often_is_a_trap():
    missions = frontier(1, robot={"reach_m": 0.5})
    strategy = MutualInformation()
    strategy.reset(missions.scenario, np.random.default_rng(0))
    missions.precision[0, 0][:] = 1e4
    missions.precision[0, 0][3, 5, 2] = 1.0
    missions.state.robots[0, 0]["depth_m"] = 0.0
    put(missions, 0, (1.75, 2.75, 1.25, 0.0, 0.0))
    picks = [strategy.choose(view_of(missions, 0, 0)) for _ in range(12)]
    gazes = [round(float(pick[3]), 3) for pick in picks]
    usual = max(set(gazes), key=gazes.count)
    assert usual == pytest.approx(math.atan2(1, 1), abs=2e-3) or gazes.count(usual) >= 4
    assert len(set(gazes)) >= 4  # and in between it wandered


def test_flying_robots_climb_the_gradient():
    missions = started(free_box(robots=1, robot={"reach_m": 2.0}))
    missions.mean[0, 0][:] = 0.05
    missions.precision[0, 0][:] = 1e4
    missions.precision[0, 0][:, :, 4] = 1e-3
    put(missions, 0, (1.75, 2.75, 1.25, 0.0, 0.0))
    for viewpoint in chosen(missions):
        assert viewpoint[2] == pytest.approx(2.25) and viewpoint[4] == pytest.approx(-math.pi / 2)


def test_one_robot_is_not_coordinated_with_anybody():
    ends = []
    for name in ("mutual-information", "ground-gradient"):
        env = EntropyExploreEnv(scripted(with_settings(LAB, {"robots": 1, "ending": {"sigma_end": 0.3}})))
        run_mission(env, make_strategy(name), 2)
        ends.append(env.missions.state.robots.tobytes())
    assert ends[0] == ends[1]
    assert {"mutual-information", "ground-gradient"} <= set(STRATEGIES)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("coordinated", 1),
        ("distance_cost", -0.1),
    ],
)
def test_settings_out_of_range_are_refused(name, value):
    with pytest.raises(SettingError, match=f"{name} = {value!r}"):
        MutualInformation(**{name: value})
