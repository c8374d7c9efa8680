"""The strategy `planned-rate`: how soon it is done, what it remembers, and that it never stands still."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies.rules.nearest_frontier import NearestFrontier
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.explorer import planned_rate
from entropy_explore_env.explorer.explorer import Explorer
from entropy_explore_env.explorer.planned_rate import PlannedRate, tours_what_is_left
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import OFFICE_3D, ROOM, SCENARIOS, find_scenario


class FirstCandidate:
    """Chooses the first of the candidates that the planner proposes to a policy, which is its own choice."""

    def reset(self, scenario, rng):
        self._proposer = ViewProposer(with_settings(scenario, {"action": {"kind": "candidates"}}), rng)

    def choose(self, view):
        return self._proposer.propose(view)[0].copy()


def figures_of(strategy, scenario=ROOM, seed=0, **settings):
    env = EntropyExploreEnv(with_settings(scripted(scenario), settings))
    run_mission(env, strategy, seed)
    return mission_figures(env.missions, 0)


@pytest.mark.parametrize(
    ("name", "robots", "share"),
    [("room-furnished", 3, 0.4), ("office", 1, 0.7)],
)
def test_it_is_sooner_done_than_nearest_frontier(name, robots, share):
    ours, theirs = (
        [figures_of(make(), find_scenario(name), seed, robots=robots)["t_mission_s"] for seed in (0, 1)]
        for make in (PlannedRate, NearestFrontier)
    )
    assert sum(ours) < share * sum(theirs)


def test_mixed_teams_take_the_recipe_of_each_kind():
    mixed = find_scenario("office-mixed")
    figures = figures_of(PlannedRate(), mixed, seed=1, robots=2, ending={"time_limit_s": 40.0})
    assert all(robot["scans"] > 4 for robot in figures["per_robot"])


def test_where_everything_is_to_be_seen_no_time_goes_to_known_walls():
    """The planner's first candidate took 4,377 scans and 2,818 s here, most of them of walls that it knew."""
    ending = {"seen_share": 1.0, "time_limit_s": 3000.0}
    settings = {"robots": 1, "track_truth": True, "split": "train", "ending": ending}
    figures = figures_of(FirstCandidate(), SCENARIOS["office"], **settings)
    assert figures["finished"] and figures["scans"] < 400 and figures["t_mission_s"] < 1500.0


DRONES = {
    "grid": Grid((160, 60, 20), 0.1),
    "robots": 2,
    "robot": {"body_radius_m": 0.3, "reach_m": 10.0, "redecide": 0.5},
    "sensor": {
        "field_of_view_rad": (6.283185307179586, 1.0),
        "angular_step_rad": 0.1,
        "max_range_m": 5.0,
        "scan_time_s": 0.1,
        "scan_every_m": 0.2,
    },
    "ending": {"seen_share": 0.99, "time_limit_s": 300.0},
    "track_truth": True,
}
"""Settings of drones that scan in flight, in a grid that is fine for them."""


@pytest.mark.parametrize(
    ("settings", "wanted"),
    [
        ({}, True),
        ({"sensor": {"scan_every_m": float("inf")}}, False),
        ({"sensor": {"field_of_view_rad": (2.0, 1.0)}}, False),
        ({"ending": {"seen_share": None}}, False),
        ({"ending": {"return_to_start": True}}, False),
        ({"grid": Grid((64, 24, 8), 0.25)}, False),
    ],
)
def test_drones_that_scan_in_flight_tour_what_is_left_in_fine_grids(settings, wanted):
    scenario = with_settings(with_settings(OFFICE_3D, DRONES), settings)
    assert tours_what_is_left(scenario, scenario.kind_of(0)) == wanted


def test_gains_are_low_where_a_robot_gained_little_lately_by_hand(monkeypatch):
    monkeypatch.setattr(planned_rate, "_LATELY_S", 10.0)
    monkeypatch.setattr(planned_rate, "_LITTLE", 0.2)
    gains = planned_rate._Gains()

    def low(time_s, gained_bits):
        return gains.are_low(SimpleNamespace(time_s=time_s, gained_bits=gained_bits))

    assert not low(0.0, 0.0) and not low(9.5, 1.0)  # too early to tell
    # 20 bits a second for 100 s, and nothing then:
    assert not any(low(0.5 * k, 10.0 * k) for k in range(20, 201))
    assert not low(107.5, 2000.0)  # of the last ten seconds 2.5 s count: 5 bits a second, 3.7 are little
    assert low(108.5, 2000.0)  # 3 bits a second
    assert not low(109.0, 2040.0)


class Watched(PlannedRate):
    """The planner, and what its robots did: whether on a tour, and whether they stayed where they were."""

    def reset(self, scenario, rng):
        super().reset(scenario, rng)
        self.did = [[(False, False)] for _ in range(scenario.robots)]

    def choose(self, view):
        viewpoint = super().choose(view)
        stays = bool(np.allclose(viewpoint[:3], view.pose[:3], atol=1e-3))
        self.did[view.robot].append((self._by_frontiers[view.robot], stays))
        return viewpoint


def test_drones_tour_what_is_left_while_they_gain_little_and_go_back_to_bits_per_time(monkeypatch):
    monkeypatch.setattr(planned_rate, "_LATELY_S", 3.0)
    monkeypatch.setattr(planned_rate, "_LITTLE", 0.6)
    scenario, strategy = with_settings(scripted(OFFICE_3D), DRONES), Watched()
    env = EntropyExploreEnv(with_settings(scenario, {"robots": 3}))
    run_mission(env, strategy, 2)
    assert mission_figures(env.missions, 0)["finished"]
    pairs = [pair for did in strategy.did for pair in pairwise(did)]
    begun = [after for before, after in pairs if before[0] < after[0]]
    assert len(begun) > 5 and sum(stays for _, stays in begun) <= 1  # no first look around
    assert sum(before[0] > after[0] for before, after in pairs) > 5


def test_below_an_exposure_surface_drones_do_not_tour(monkeypatch):
    monkeypatch.setattr(planned_rate, "_LATELY_S", 1.0)
    monkeypatch.setattr(planned_rate, "_LITTLE", 2.0)
    body = {"navigator": "planned", "body_radius_m": 2.0, "reach_m": 40.0}
    ground = {**DRONES, "grid": Grid((160, 120, 24), 0.6), "robots": 1}
    scenario = with_settings(with_settings(find_scenario("terrain"), ground), {"robot": body})
    assert tours_what_is_left(scenario, scenario.kind_of(0))
    figures_of(PlannedRate(), scenario, 2, ending={"time_limit_s": 20.0})


def test_a_drone_that_finds_no_frontier_cell_goes_on_by_bits_per_time(monkeypatch):
    """Unknown space lies behind a grille, which its body does not come near enough to touch."""
    monkeypatch.setattr(planned_rate, "_LATELY_S", 5.0)
    grille = np.full((120, 60, 30), 100, np.int8)
    grille[2:60, 2:58, 2:28], grille[61:66, 4:56, 4:26], grille[66:110, 4:56, 2:28] = 0, 0, -1
    for row in range(6, 10):
        grille[60, row:54:8, 6:24] = 0
    scenario = with_settings(OFFICE_3D, DRONES)
    explorer = Explorer(robot=scenario.robot, sensor=scenario.sensor, voxel_size_m=0.1)
    explorer.set_map(grille, (0.0, 0.0, 0.0))
    pose = [5.0, 3.0, 1.2, 0.0, 0.0]
    for time_s in (0.0, 6.0, 6.5, 7.0):
        goal = explorer.goal([pose], time_s=time_s)
        assert goal is not None and goal.expected_bits > 1000.0
        pose = goal.viewpoint.tolist()
