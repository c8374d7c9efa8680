"""Whole missions: as far as the textbook's, no robot stands still, bodies part, and what is refused."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import make_strategy
from baselines.strategies.rules.distance_advantage import DistanceAdvantage
from baselines.strategies.rules.information_gain import InformationGain
from baselines.strategies.rules.nearest_frontier import NearestFrontier
from baselines.strategies.rules.receding_horizon import RecedingHorizon
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.frontier_map import KNOWN_SIGMA
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.planner.tour import Tour
from entropy_explore_env.reports.metrics import joint_figures, mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import BOX, find_scenario
from tests.planner.scenes import small_plan, varied
from tests.reference import explorers as reference
from tests.reference import planners

NAMES = (
    "nearest-frontier",
    "coordinated-frontier",
    "assigned-frontier",
    "information-gain",
    "distance-advantage",
    "receding-horizon",
    "tour",
)
SHARE = 0.995


def path_m(strategy, seed, scenario):
    """Metres until SHARE of what can be seen was seen."""
    env, seen = EntropyExploreEnv(scenario), []

    class EnoughError(Exception):
        """All is seen."""

    def look(env):
        explored = joint_figures(env.missions, 0)["explored"] or 0.0
        if explored >= SHARE:
            seen.append(float(mission_figures(env.missions, 0)["distance_m"]))
            raise EnoughError

    with pytest.raises(EnoughError):
        run_mission(env, strategy, seed, look)
    return seen[0]


REACH = 15.0
"""Of the sensor of `small_plan`, in cells."""
RULES = {
    "nearest-frontier": (NearestFrontier, lambda: reference.Textbook(reference.nearest_frontier)),
    "distance-advantage": (
        lambda: varied(DistanceAdvantage(), radius=25, horizon=26.0),
        lambda: reference.Textbook(partial(reference.distance_advantage, radius=25, horizon=26.0)),
    ),
    "information-gain": (
        lambda: varied(InformationGain(), weight=0.4, horizon=3.0),
        lambda: reference.Textbook(partial(planners.information_gain, weight=0.4, horizon=3.0, reach=REACH)),
    ),
    "tour": (Tour, lambda: reference.Textbook(planners.Tour(REACH, 0.4, 0.4, 1.0, 0.1))),
    "receding-horizon": (
        RecedingHorizon,
        lambda: reference.Textbook(
            planners.RecedingHorizon(REACH, 8.0, 0.4, 1.5, (30, 120)), until_reached=True
        ),
    ),
}
"""Name → what makes ours, and what makes the textbook's."""


def ratios(rule, starts):
    """Path lengths of a strategy over those of the textbook, start by start."""
    ours, textbook = RULES[rule]
    plan = small_plan()
    return np.array([path_m(ours(), seed, plan) / path_m(textbook(), seed, plan) for seed in starts])


def test_the_path_to_nearest_frontiers_is_the_textbooks():
    assert ratios("nearest-frontier", [0]) == pytest.approx([1.0], rel=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("rule", sorted(RULES))
def test_over_thirty_starts_paths_are_as_long_as_the_textbooks(rule):
    """Ties are broken differently, so single missions differ; their geometric mean by no more than 3 %.

    Trees are drawn, and tours differ by their places, so that thirty missions leave an error of the mean.
    """
    logs = np.log(ratios(rule, range(30)))
    error = logs.std(ddof=1) / math.sqrt(len(logs)) if rule in ("tour", "receding-horizon") else 0.0
    assert abs(logs.mean()) < math.log(1.03) + 2.0 * error


def office(scan_every_m):
    """An office of 40 × 32 m for a point robot with a lidar of 4.5 m, until every free cell was seen."""
    settings = {
        "grid": Grid((160, 128, 1), 0.25),
        "robots": 1,
        "robot": {"reach_m": math.inf, "body_radius_m": 0.0, "redecide": "on_scan"},
        "sensor": {"max_range_m": 4.5, "angular_step_rad": math.pi / 180, "scan_every_m": scan_every_m},
        "ending": {"unseen_free_voxels": 0, "time_limit_s": 1e4},
    }
    return with_settings(scripted(find_scenario("office")), settings)


OFFICE_RULES = {
    "nearest-frontier": (0.375, reference.nearest_frontier),
    "distance-advantage": (0.5, partial(reference.distance_advantage, radius=60, horizon=61.0, block=4)),
}
"""Name → metres between decisions, and the textbook's rule."""


@pytest.mark.long
@pytest.mark.parametrize("rule", OFFICE_RULES)
def test_in_offices_paths_are_no_longer_than_the_textbooks(rule):
    """In 152 × 64 m, too, where it takes hours: see docs/explorers.md."""
    scan_every_m, values = OFFICE_RULES[rule]
    env, logs = EntropyExploreEnv(office(scan_every_m)), []
    for seed in range(3):
        driven_m = []
        for strategy in (make_strategy(rule), reference.Textbook(values)):
            run_mission(env, strategy, seed)
            figures = mission_figures(env.missions, 0)
            assert figures["finished"]
            driven_m.append(figures["distance_m"])
        logs.append(math.log(driven_m[0] / driven_m[1]))
    assert sum(logs) / 3 < math.log(1.02)


@pytest.mark.parametrize("name", NAMES)
def test_every_explorer_sees_a_plan(name):
    assert path_m(make_strategy(name), 3, small_plan()) < 60.0


class SeenOnce(NearestFrontier):
    """Content with having seen everything once."""

    def reset(self, scenario, rng):
        super().reset(scenario, rng)
        self._finest = KNOWN_SIGMA


def test_who_finds_no_frontier_drives_to_a_random_place_and_not_to_another_at_each_scan():
    """The last voxels of a plan may lie behind one that is believed covered and is not."""
    strategy, kept = SeenOnce(), []
    env = EntropyExploreEnv(small_plan(ending={"sigma_end": 1e-3, "time_limit_s": 500.0}))
    last, was_under_way = None, False

    def look(env):
        nonlocal last, was_under_way
        elsewhere = strategy._trails[0].random
        if elsewhere is not None and last is not None:
            kept.append(bool((elsewhere == last).all()))
            assert kept[-1] == was_under_way
        last, was_under_way = elsewhere, env.view("robot_0").under_way

    run_mission(env, strategy, 0, look)
    assert kept.count(True) > 2 * kept.count(False) > 20


@pytest.mark.parametrize(
    "name", ["mutual-information", "ground-gradient", "per-time-visibility", "voronoi", "voronoi-nearest"]
)
def test_missions_in_a_box_end(name):
    env = EntropyExploreEnv(with_settings(scripted(BOX), {"time_limit_s": 2000.0}))
    run_mission(env, make_strategy(name), 0)
    assert env.missions.over(0) is MissionEnd.MAPPED


@pytest.mark.parametrize("name", NAMES)
def test_in_space_each_call_gains_or_moves(name):
    """Two flying robots with cameras: they map on, and none stands still for long."""
    settings = {"robots": 2, "ending": {"time_limit_s": 40.0}, "track_truth": True}
    scenario = with_settings(scripted(find_scenario("room-furnished")), settings)
    env, idle = EntropyExploreEnv(scenario), [0, 0]
    last = [None, None]

    def look(env):
        for robot in range(2):
            view = env.view(f"robot_{robot}") if env.agents else None
            if view is None or not view.deciding:
                continue
            now = (*view.pose.round(6), round(view.entropy_bits, 3))
            idle[robot] = idle[robot] + 1 if now == last[robot] else 0
            last[robot] = now
            assert idle[robot] < 5

    run_mission(env, make_strategy(name), 1, look)
    assert (joint_figures(env.missions, 0)["explored"] or 0.0) > 0.5


@pytest.mark.parametrize("name", [*NAMES, "next-best-view", "raster"])
def test_a_world_under_an_exposure_surface_is_refused_with_the_reason(name):
    env = EntropyExploreEnv(with_settings(scripted(find_scenario("terrain")), {"robots": 1}))
    with pytest.raises(SettingError, match=f"{name}.*exposure surface"):
        run_mission(env, make_strategy(name), 0)
