"""The strategy `planned-rate`: how soon it is done, what it remembers, and that it never stands still."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import planned_rate
from baselines.strategies.information_rate_v0 import InformationRate
from baselines.strategies.planned_rate import (
    PlannedRate,
    _comes_near,
    _experience,
    _Memory,
    _Remembered,
    _Weigher,
)
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX, OFFICE, ROOM, find_scenario
from entropy_explore_env.viewpoints.candidates import Candidates
from entropy_explore_env.viewpoints.recipe import NARROW_PLANNED


def figures_of(strategy, scenario=ROOM, seed=0, **settings):
    env = EntropyExploreEnv(with_settings(scripted(scenario), settings))
    run_mission(env, strategy, seed)
    return mission_figures(env.missions, 0)


@pytest.mark.parametrize(("name", "robots", "share"), [("room-furnished", 3, 0.98), ("office", 1, 0.85)])
def test_it_is_sooner_done_than_its_predecessor(name, robots, share):
    ours, before = (
        [figures_of(make(), find_scenario(name), seed, robots=robots)["t_mission_s"] for seed in (0, 1)]
        for make in (PlannedRate, InformationRate)
    )
    assert sum(ours) < share * sum(before)


def test_the_same_seed_gives_the_same_mission():
    first, second = (figures_of(PlannedRate(), BOX, seed=4) for _ in range(2))
    assert first == second and first["finished"]


def test_mixed_teams_take_the_recipe_of_each_kind():
    mixed = find_scenario("office-mixed")
    figures = figures_of(PlannedRate(), mixed, seed=1, robots=2, ending={"time_limit_s": 40.0})
    assert all(robot["scans"] > 4 for robot in figures["per_robot"])


@pytest.fixture
def view():
    env = EntropyExploreEnv(scripted(with_settings(OFFICE, {"robots": 2})))
    env.reset(seed=0)
    return env.view("robot_0")


def test_what_brought_nothing_and_what_was_not_reached_is_not_tried_again(view):
    here = view.scenario.grid.in_grid_units(view.pose)
    memory = _Memory(chosen=here.copy(), expected=100.0)
    _experience(memory, view, here)  # no scan was taken: nothing came
    elsewhere = here + np.array([3.0, 0.0, 0.0, 0.0, 0.0])
    memory.chosen = elsewhere
    _experience(memory, view, here)
    assert [each.share for each in memory.avoided] == [0.0, 0.0]
    viewpoints = np.stack([here, elsewhere, here + np.array([0.0, 2.0, 0.0, 0.0, 0.0])])
    np.testing.assert_array_equal(_Weigher(memory, view)(viewpoints, np.full(3, 5.0)), [0.0, 0.0, 5.0])
    far_off = here + np.array([50.0, 0.0, 0.0, 0.0, 0.0])
    memory.chosen = None
    _experience(memory, view, far_off)
    assert memory.avoided == []


def test_a_robot_that_a_teammate_blocked_keeps_clear_of_it(view):
    grid = view.scenario.grid
    here = grid.in_grid_units(view.pose)
    mate_at = view.pose + np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    heard = dataclasses.replace(view.teammates[1], heard_s=0.0, pose=mate_at)
    blocked = dataclasses.replace(view, move_end=MoveEnd.TEAMMATE, teammates={1: heard})
    memory = _Memory(chosen=here + np.array([4.0, 0.0, 0.0, 0.0, 0.0]))
    _experience(memory, blocked, here)
    assert memory.blocked > 0
    ahead, behind = (here + np.array([dx, 0.0, 0.0, 0.0, 0.0]) for dx in (8.0, -8.0))
    worth = _Weigher(memory, blocked)(np.stack([ahead, behind, here]), np.ones(3))
    np.testing.assert_array_equal(worth, [0.0, 1.0, 1.0])
    free = _Weigher(_Memory(), blocked)(np.stack([ahead]), np.ones(1))
    assert free[0] == 1.0


def test_bodies_that_touch_may_part():
    here, body = np.zeros(3), np.array([1.0, 0.0, 0.0])
    places = np.array([[-2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [0.5, 2.0, 0.0]])
    np.testing.assert_array_equal(_comes_near(here, places, body, 1.5), [False, True, False, False, True])


def test_where_nothing_is_left_nearby_it_goes_elsewhere(view, monkeypatch):
    monkeypatch.setattr(planned_rate._Weigher, "__call__", lambda self, viewpoints, bits: 0.0 * bits)
    strategy = PlannedRate()
    strategy.reset(view.scenario, np.random.default_rng(0))
    chosen = np.stack([strategy.choose([view])[0] for _ in range(3)])
    apart = np.linalg.norm(chosen[:, :3] - view.pose[:3], axis=1)
    assert (apart > 0.05).all() and (apart <= view.kind.robot.reach_m).all()


def test_only_a_robot_that_its_belief_shuts_in_leaves_by_the_voxels_next_to_it(view):
    strategy, grid = PlannedRate(), view.scenario.grid
    strategy.reset(view.scenario, np.random.default_rng(0))
    here, memory = grid.in_grid_units(view.pose), _Memory()

    def exits(mean):
        belief = planned_rate.belief_of(view)._replace(mean=mean.reshape(-1))
        situation = planned_rate.Situation(0, here, belief, planned_rate.announced_cones(view))
        return strategy._exits(view, situation, memory)

    free = np.zeros(grid.shape, np.float32)
    assert len(exits(free)) == 0
    np.testing.assert_array_equal(memory.free_at, here[:3])
    x, y = here[:2].astype(int)
    shut = np.ones(grid.shape, np.float32)
    shut[x - 1 : x + 2, y - 1 : y + 2] = 0.0
    found = exits(shut)
    assert len(found) > 0 and (np.abs(found[:, :2] - here[:2]) < 2.0).all()
    memory.free_at = here[:3] + np.array([5.0, 0.0, 0.0])
    back = exits(shut)
    assert sorted(map(tuple, back)) == sorted(map(tuple, found))
    assert back[0, 0] == back[:, 0].max() > here[0] > back[-1, 0]


def test_what_any_scan_brings_is_worth_next_to_nothing(view):
    """Of 1,000 bits at most, one in a hundred is dregs: the first ten of any scan."""
    weigh = _Weigher(_Memory(most_bits=1000.0), view, 0.01)
    viewpoints = np.zeros((3, 5))
    np.testing.assert_allclose(weigh(viewpoints, np.array([5.0, 20.0, 510.0])), [0.05, 10.0, 500.0])
    untouched = _Weigher(_Memory(most_bits=1000.0), view)(viewpoints, np.array([5.0, 20.0, 510.0]))
    np.testing.assert_array_equal(untouched, [5.0, 20.0, 510.0])


def far_stop(view, monkeypatch, most_bits, avoided=()):
    """The first stop towards the best far place of a robot that remembers the most bits ever expected."""
    strategy, stop = PlannedRate(), view.scenario.grid.in_grid_units(view.pose) + np.array([3.0, 0, 0, 0, 0])
    strategy.reset(view.scenario, np.random.default_rng(0))
    far = Candidates(stop[None] + 9.0, np.array([500.0]), np.array([5.0]), view.kind)
    monkeypatch.setattr(strategy._planner, "far", lambda *_: far)
    monkeypatch.setattr(strategy._planner, "towards", lambda *_: stop)
    memory = _Memory(most_bits=most_bits, avoided=[_Remembered(stop, share, 6.0) for share in avoided])
    weigher = _Weigher(memory, view, NARROW_PLANNED.dregs)
    here, belief = view.scenario.grid.in_grid_units(view.pose), planned_rate.belief_of(view)
    no_cones = planned_rate.announced_cones(view)
    situation = planned_rate.Situation(0, here, belief, no_cones, None, weigher, weigher.trust)
    travel = strategy._planner.start_search(situation)
    return strategy._far_stop(situation, travel, memory, 0.0, NARROW_PLANNED), stop


@pytest.mark.parametrize("most_bits", [0.0, 1e4])
def test_a_far_stop_is_taken_however_many_bits_were_ever_expected(view, monkeypatch, most_bits):
    """Of 1e4 bits, 25 are dregs: more than the one bit of which trust in a stop was asked."""
    taken, stop = far_stop(view, monkeypatch, most_bits)
    np.testing.assert_array_equal(taken, stop)
    assert far_stop(view, monkeypatch, most_bits, avoided=[0.2])[0] is not None
    assert far_stop(view, monkeypatch, most_bits, avoided=[0.2, 0.4])[0] is None


def test_trust_is_what_is_left_of_bits_without_dregs(view):
    here = view.scenario.grid.in_grid_units(view.pose)
    memory = _Memory(most_bits=1e4, avoided=[_Remembered(here, 0.25, 6.0)])
    viewpoints = np.stack([here, here + np.array([2.0, 0.0, 0.0, 0.0, 0.0])])
    weigher = _Weigher(memory, view, NARROW_PLANNED.dregs)
    np.testing.assert_array_equal(weigher.trust(viewpoints), [0.25, 1.0])
    np.testing.assert_allclose(weigher(viewpoints, np.array([125.0, 125.0])), [25.0, 100.0])


@pytest.mark.parametrize("end", list(MoveEnd))
@pytest.mark.parametrize("drifts", [False, True])
def test_a_drive_with_drift_was_cut_short_if_something_ended_it(view, end, drifts):
    """Without drift it was wherever the robot stands elsewhere than it meant to."""
    here = view.scenario.grid.in_grid_units(view.pose)
    covariance = np.diag([1e-4, 1e-4, 0.0, 1e-6]) if drifts else np.zeros((4, 4))
    after = dataclasses.replace(view, move_end=end, covariance=covariance)
    goal = here + np.array([9.0, 0.0, 0.0, 0.0, 0.0])
    memory = _Memory(chosen=here + np.array([0.3, 0.0, 0.0, 0.0, 0.0]), goal=goal)
    _experience(memory, after, here)
    arrived = drifts and end in (MoveEnd.ARRIVED, MoveEnd.CORNERS)
    assert (memory.goal is goal) == arrived
    assert [each.share for each in memory.avoided] == ([] if arrived else [0.0])
