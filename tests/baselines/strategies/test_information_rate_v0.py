"""The strategy `information-rate-v0`: where it can go, and how soon it is done."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import information_rate_v0
from baselines.strategies.information_rate_v0 import InformationRate, InformationRateConfig, _stops
from baselines.strategies.knowledge import announced_cones
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX, ROOM, find_scenario
from entropy_explore_env.settings import Grid
from tests.reference.scenes import free_box, started

SIZE = (7, 11, 5)


def figures_of(strategy, scenario=ROOM, seed=0, **settings):
    env = EntropyExploreEnv(with_settings(scripted(scenario), settings))
    run_mission(env, strategy, seed)
    return mission_figures(env.missions, 0)


def test_the_empty_room_is_mapped_many_times_faster_than_by_the_gradient():
    for seed in range(3):
        figures = figures_of(InformationRate(), seed=seed, robots=1)
        assert figures["finished"] and figures["t_mission_s"] <= 180.0


def test_per_scan_it_needs_fewer_scans():
    figures = figures_of(InformationRate(InformationRateConfig(per_scan=True, candidates=120)), robots=1)
    assert figures["finished"] and figures["scans"] <= 140


@pytest.mark.parametrize("name", ["room-furnished", "office"])
def test_it_gets_everywhere(name):
    figures = figures_of(InformationRate(), find_scenario(name), seed=1, robots=2)
    assert figures["finished"], figures["end_reason"]


def test_the_same_seed_gives_the_same_mission():
    first, second = (figures_of(InformationRate(), BOX, seed=4) for _ in range(2))
    assert first == second


def test_teams_are_faster():
    one, four = (figures_of(InformationRate(), seed=2, robots=robots)["t_mission_s"] for robots in (1, 4))
    assert four < 0.6 * one


def test_stops_lie_within_reach_of_each_other():
    points = np.array([[4.0, 0.5, 0.5], [4.0, 2.0, 0.5]])
    stops = _stops(np.array([0.5, 0.5, 0.5]), points, 1.0)
    places = np.array([[0.5, 0.5, 0.5], *stops])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() <= 1.0
    np.testing.assert_allclose(stops[-1], points[-1])
    assert any(np.allclose(stop, points[0]) for stop in stops)


def test_what_a_teammate_announced_is_left_to_it():
    missions = started(free_box(robots=2), seed=3)
    alone = announced_cones(view_of(missions, 0, 0))
    assert len(alone) == 0  # nothing was heard
    heard = missions.state.heard[0, 0, 1]
    heard["announced_s"], heard["announced"] = 0.0, (1.75, 2.75, 1.25, 0.5, 0.1, 2.0, math.pi / 4)
    (cone,) = announced_cones(view_of(missions, 0, 0))
    assert cone["apex"] == pytest.approx((3.5, 5.5, 2.5))
    assert (cone["radius"], cone["cosine"]) == pytest.approx((4.0, math.cos(math.pi / 4)))


def test_a_path_whose_first_stop_is_out_of_sight_is_not_taken(monkeypatch):
    """Once it was searched again and again."""
    monkeypatch.setattr(information_rate_v0, "is_line_free", lambda *_: False)
    env = EntropyExploreEnv(scripted(with_settings(ROOM, {"robots": 1})))
    env.reset(seed=0)
    strategy = InformationRate()
    strategy.reset(env.scenario, env.strategy_generator())
    asked = []

    def stops(*_):
        asked.append(1)
        return [np.array([3.5, 3.5, 3.5])]

    monkeypatch.setattr(strategy, "_stops_to_a_better_place", stops)
    strategy._plans[0].best_bits, strategy._plans[0].patience = 1e9, 0
    (viewpoint,) = strategy.choose([env.view("robot_0")])
    assert asked == [1] and np.isfinite(viewpoint).all()
    assert strategy._plans[0].stops == [] and strategy._plans[0].patience > 0


def test_it_does_not_fly_into_the_ceiling_that_it_knows():
    """Paths to a better place, planned by the strategy itself for robots that drive straight."""
    settings = {
        "grid": Grid((30, 24, 16), 1.0),
        "robots": 1,
        "robot": {"body_radius_m": 0.8},
        "decision_period_s": None,
        "ending": {"sigma_end": 1e-3, "time_limit_s": 300.0},
    }
    env = EntropyExploreEnv(with_settings(find_scenario("terrain"), settings))
    env.reset(seed=0)
    view = env.view("robot_0")
    world, no_fly = env.missions.worlds[0], view.no_fly_mask()
    assert world is not None and no_fly is not None
    np.testing.assert_array_equal(no_fly, world.no_fly_mask(0.8))
    strategy = InformationRate()
    strategy.reset(env.scenario, env.strategy_generator())
    drawn = strategy._drawn_voxels(view, view.pose[:3], no_fly)
    assert len(drawn) > 0 and not no_fly.reshape(-1)[drawn].any()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("candidates", 3),
        ("refinements", -1),
        ("thinning", 0),
        ("places", 0),
        ("stop_probability", 2.0),
        ("poor", math.nan),
        ("unknown_cost", 0.5),
    ],
)
def test_settings_that_make_no_sense_are_refused_by_name(field, value):
    with pytest.raises(SettingError, match=rf"InformationRateConfig\.{field} = {value}"):
        InformationRateConfig(**{field: value})
