"""Robots that drift do not try a blocked drive twice, nor stand still for good, whatever the strategy."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from baselines.experiments.mission import Followed, run_mission, scripted_env
from baselines.strategies import make_strategy
from baselines.strategies.rules.cliff import CliffNextBestView
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.frontier_map import FrontierConfig
from entropy_explore_env.frontiers.terrain_frontiers import TerrainFrontiers
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.scenarios import CLIFF, find_scenario
from tests.reference.scenes import free_box, put, started

DRIFT = {"xy_m_per_sqrt_m": 0.02, "yaw_rad_per_sqrt_m": 0.01, "yaw_rad_per_sqrt_rad": 0.01}
HERE = (1.75, 2.75, 1.25, 0.0, 0.0)
AHEAD = np.array([1.75, 3.75, 1.25, 0.3, 0.0])


class Fixed:
    """Chooses the viewpoints that it was given, one after the other, and then the last one."""

    def __init__(self, *viewpoints):
        self.viewpoints, self.draws = list(viewpoints), []

    def reset(self, scenario, rng):
        self.rng = rng

    def choose(self, view):
        self.draws.append(self.rng.random())
        return (self.viewpoints.pop(0) if len(self.viewpoints) > 1 else self.viewpoints[0]).copy()


def guarded(*viewpoints):
    """A function that lets such a strategy choose after a drive that ended so."""
    scenario = free_box(robots=1, robot={"localization": DRIFT})
    missions = started(scenario)
    put(missions, 0, HERE)
    guard = Followed(Fixed(*viewpoints))
    guard.reset(scenario, np.random.default_rng(5))
    view = view_of(missions, 0, 0)

    def choose(end, uncertain=True, pose=HERE):
        covariance = np.eye(4) * 0.01 if uncertain else np.zeros((4, 4))
        now = dataclasses.replace(view, move_end=end, covariance=covariance, pose=np.array(pose))
        return guard.choose(now)

    return choose


def test_a_robot_that_gets_on_keeps_to_its_strategy():
    choose = guarded(AHEAD)
    for number in range(40):
        pose = (1.75, 1.0 + 0.75 * (number % 4), 1.25, 0.0, 0.0)
        assert (choose(MoveEnd.ARRIVED, pose=pose) == AHEAD).all()


def test_a_blocked_drive_is_not_tried_again():
    choose = guarded(AHEAD)
    assert (choose(MoveEnd.ARRIVED) == AHEAD).all()
    for end in (MoveEnd.OBSTACLE, MoveEnd.NO_PATH):
        back = choose(end)
        step = back[:3] - HERE[:3]
        assert step @ (AHEAD[:3] - HERE[:3]) <= 0.0
        assert 0.0 < np.linalg.norm(step) <= 6.0 * 0.5
        assert (choose(MoveEnd.ARRIVED, pose=(1.75, 1.0, 1.25, 0.0, 0.0)) == AHEAD).all()


def test_another_way_may_be_tried_after_one_block_and_not_after_two():
    others = [np.array([0.6 + 0.5 * number, 0.6, 1.25, 0.0, 0.0]) for number in range(5)]
    choose = guarded(AHEAD, *others)
    choose(MoveEnd.ARRIVED)
    assert (choose(MoveEnd.OBSTACLE) == others[0]).all()
    assert not (choose(MoveEnd.OBSTACLE)[:3] == others[1][:3]).all()


def test_a_robot_that_stands_still_goes_elsewhere():
    choose = guarded(np.array(HERE))
    chosen = [choose(MoveEnd.ARRIVED) for _ in range(40)]
    moved = [number for number, viewpoint in enumerate(chosen) if (viewpoint[:3] != HERE[:3]).any()]
    assert moved == [15, 30]


@pytest.mark.parametrize("end", [MoveEnd.OBSTACLE, MoveEnd.ARRIVED])
def test_a_robot_that_knows_where_it_is_keeps_to_its_strategy(end):
    choose = guarded(np.array(HERE))
    assert all((choose(end, uncertain=False) == HERE).all() for _ in range(40))


def test_the_strategy_draws_as_it_does_alone():
    scenario, draws = free_box(robots=1, robot={"localization": DRIFT}), []
    for guards in (False, True):
        strategy = Fixed(AHEAD)
        used = Followed(strategy) if guards else strategy
        used.reset(scenario, np.random.default_rng(5))
        view = dataclasses.replace(view_of(started(scenario), 0, 0), covariance=np.eye(4))
        for end in (MoveEnd.ARRIVED, MoveEnd.OBSTACLE, MoveEnd.OBSTACLE):
            used.choose(dataclasses.replace(view, move_end=end))
        draws.append(strategy.draws)
    assert draws[0] == draws[1]


def test_margin_and_guard_end_endless_blocks():
    """What was seen: along a wall, off by less than a voxel, `nearest-frontier` was blocked for ever."""
    most = {}
    for margin_m, guards in ((0.0, False), (0.1, True)):
        task = with_settings(
            find_scenario("cluttered"),
            {
                "robots": 1,
                "robot": {"localization": {**{k: 0.3 * v for k, v in DRIFT.items()}, "margin_m": margin_m}},
                "fiducials": {"number": 10},
                "ending": {"seen_share": 0.9, "time_limit_s": 150.0},
            },
        )
        env = scripted_env(task)
        run_mission(env, make_strategy("nearest-frontier"), 0, backs_off=guards)
        most[guards] = int(env.missions.state.robots[0]["blocked_moves"][0])
    assert most[False] > 50 and most[True] < 5


def test_a_margin_counts_where_robots_drift_alone():
    assert Robot(body_radius_m=0.3, localization=Localization(margin_m=0.2)).planning_radius_m == 0.3
    drifting = Robot(body_radius_m=0.3, localization=Localization(**DRIFT, margin_m=0.2))
    assert drifting.planning_radius_m == pytest.approx(0.5)
    assert not Localization(margin_m=0.2).drifts
    for wrong in (-0.1, float("nan"), 101.0):
        with pytest.raises(SettingError, match=r"Localization\.margin_m"):
            Localization(margin_m=wrong)


def test_a_margin_keeps_from_ceilings_and_from_steep_ground():
    """Where robots drift, plans, views and frontiers over terrain keep clear of ceilings by the margin."""
    settings = {
        "grid": Grid((30, 24, 16), 1.0),
        "robots": 1,
        "robot": {"body_radius_m": 0.8, "navigator": "planned", "localization": {**DRIFT, "margin_m": 1.5}},
    }
    env = EntropyExploreEnv(with_settings(find_scenario("terrain"), settings))
    env.reset(seed=0)
    view, world = env.view("robot_0"), env.missions.worlds[0]
    wider = world.no_fly_mask(2.3)
    assert wider.sum() > world.no_fly_mask(0.8).sum()
    np.testing.assert_array_equal(view.no_fly_mask(), wider)
    np.testing.assert_array_equal(env.missions._no_fly[0], wider.ravel())
    kind, frontiers = env.scenario.kinds[0], FrontierConfig()
    exact = dataclasses.replace(kind, robot=dataclasses.replace(kind.robot, localization=Localization()))
    reach = [
        TerrainFrontiers(env.scenario, each, frontiers, view.ceiling).body_reach for each in (exact, kind)
    ]
    assert reach == [1, 2]


def test_a_margin_keeps_rovers_from_the_edge():
    """The columns in which a rover may stand shrink by the margin, from the same map."""
    env = scripted_env(with_settings(CLIFF, {"max_cycles": 6}))
    strategy = make_strategy("cliff-next-best-view")
    run_mission(env, strategy, 0)
    assert isinstance(strategy, CliffNextBestView)
    view, ground = env.view("robot_0"), strategy.ground_of(0)
    drifting = {"robot": {"localization": {**DRIFT, "margin_m": 0.25}}}
    wider = dataclasses.replace(view, scenario=with_settings(view.scenario, drifting))
    safe, safer = ground.safe(view, "polygon"), ground.safe(wider, "polygon")
    assert 0 < safer.sum() < safe.sum() and safe[safer].all()
    away = np.asarray(distance_transform_edt(safe))
    assert away[safer].min() >= 1.5  # 0.25 m are two columns, between middles of voxels
