"""The strategy `voronoi`: what it holds uncertain, where it goes, and how missions end."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import make_strategy
from baselines.strategies.rules.voronoi import VoronoiCoverage
from baselines.strategies.territory import deviation_entropy, filtered, inflate_obstacles
from entropy_explore_env.belief.entropy import LN2
from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import find_scenario
from tests.reference.scenes import build_known, free_box, started


def test_entropies_by_hand():
    falling = deviation_entropy(np.array([1e-2, 1.0, 1e2, 1e4], np.float32), 1e-2, 1e2)
    np.testing.assert_allclose(falling, [LN2, LN2 / 2, 0.0, 0.0], atol=1e-7)
    field = np.full((4, 5, 1), LN2, np.float32)
    field[1, 1] = 0.1
    low = filtered(field)
    assert (low[:3, :3] == np.float32(0.1)).all() and (low[3] == np.float32(LN2)).all()


def test_where_a_body_does_not_fit_by_hand():
    mean = np.zeros((5, 7, 1), np.float32)
    mean[2, 3] = 1.0
    rates = np.ones((5, 7, 1), np.float32)
    inflate_obstacles(mean, new_lattice(mean.shape, 0.6), (2, 2, 0), rates)
    closed = np.isinf(rates[:, :, 0])
    assert closed[0].all() and closed[:, 6].all() and closed[2, 3] and closed[1, 3] and closed[2, 4]
    assert not closed[2, 2] and not closed[2, 1] and not closed[1, 2]  # its start, and what it touches there


@pytest.mark.parametrize("name", ["voronoi", "voronoi-nearest"])
def test_an_office_is_explored(name):
    env = EntropyExploreEnv(with_settings(scripted(find_scenario("office")), {"track_truth": True}))
    run_mission(env, make_strategy(name), 1)
    figures = mission_figures(env.missions, 0)
    assert figures["finished"] and figures["joint"]["explored"] > 0.95


def corridor_missions(places):
    """A corridor of voxels, robots in it; both know all of one another."""
    missions = started(free_box(robots=2, robot={"reach_m": 50.0}))
    solid = np.ones(missions.grid.shape, bool)
    solid[3, 1:10, 2] = False
    build_known(missions, solid, [(3, y, 2) for y in places])
    for robot in range(2):
        seen = missions.state.heard[0, robot, 1 - robot]
        seen["heard_s"], seen["pose"][:3] = 0.0, missions.state.robots[0, 1 - robot]["origin"][:3]
    return missions


def chosen(missions, control="projected-centroid"):
    strategy = VoronoiCoverage(control)
    strategy.reset(missions.scenario, np.random.default_rng(0))
    views = [view_of(missions, 0, robot) for robot in range(2)]
    return [missions.grid.voxel_of(v[:3])[1] for v in [strategy.choose(view) for view in views]]


def test_robots_that_know_all_spread_to_the_middles_of_their_halves():
    assert chosen(corridor_missions((1, 3))) == [1, 6]  # cells 1-2 and 3-9, ties to the first
    assert chosen(corridor_missions((2, 7))) == [2, 7]


@pytest.mark.parametrize("control", ["projected-centroid", "nearest"])
def test_each_goes_to_what_is_uncertain_in_its_own_half(control):
    missions = corridor_missions((3, 6))
    for robot in range(2):
        for y in (1, 9):
            missions.mean[0, robot][2:5, max(y - 1, 0) : y + 2, 1:4] = 0.5
            missions.precision[0, robot][2:5, max(y - 1, 0) : y + 2, 1:4] = 1e-3
    first, second = chosen(missions, control)
    assert first < 3 and second > 6


def test_another_control_is_refused():
    with pytest.raises(SettingError, match="control = 'frontier'"):
        VoronoiCoverage("frontier")
