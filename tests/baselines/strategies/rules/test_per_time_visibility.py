"""Per-time visibility: lazily it allocates as eagerly, robots wait for each other, and missions end."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from baselines.experiments.mission import scripted
from baselines.papers.sawhney.mission import explore_until_done
from baselines.strategies.allocation import ExplorationConfig
from baselines.strategies.rules.per_time_visibility import PerTimeVisibility
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.frontier_map import FrontierConfig, FrontierMap
from entropy_explore_env.frontiers.terrain_frontiers import TerrainFrontiers
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.frontiers.voxel_states import COVERED
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import joint_figures, mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import find_scenario
from tests.planner import scenes

PERFECT = {"burst": 10_000, "i_min_bits": 0.0}


def small_plan(**settings):
    """A quarter of an office, for robots without bodies that go anywhere, and decide at stops."""
    changes = {
        "robots": 3,
        "robot": {"redecide": "at_stop", "unknown_cost": 1e4},
        "sensor": {"scan_every_m": math.inf, "scan_time_s": 2.0},
        "channel": PERFECT,
        "ending": {"time_limit_s": 900.0},
    }
    return with_settings(with_settings(scenes.small_plan(), changes), settings)


def small_terrain(**settings):
    base = with_settings(scripted(find_scenario("terrain")), {"grid": Grid((31, 25, 16), 1.0)})
    changes = {
        "robots": 2,
        "robot": {"reach_m": math.inf, "body_radius_m": 0.0},
        "sensor": {
            "field_of_view_rad": (2 * math.pi, math.pi / 2),
            "angular_step_rad": math.pi / 30,
            "max_range_m": 12.0,
        },
        "channel": PERFECT,
        "ending": {"sigma_end": 1e-3, "time_limit_s": 600.0},
    }
    return with_settings(base, {**changes, **settings})


def eagerly(self, voxels, worth):
    """`FrontierMap.worths` that counts V of each candidate."""
    return worth(self.count(voxels), np.arange(len(voxels)))


class Noting(PerTimeVisibility):
    """Notes when each robot left for its candidates, and when it was through with each, in seconds."""

    def reset(self, scenario, rng):
        super().reset(scenario, rng)
        self.trips = [[] for _ in range(scenario.robots)]

    def pick(self, scene):
        trips, now_s = self.trips[scene.view.robot], scene.view.time_s
        if trips and len(trips[-1]) == 1:
            trips[-1].append(now_s)
        picked = super().pick(scene)
        if picked >= 0:
            trips.append([now_s])
        return picked

    def rounds(self):
        """(left, ended) of the first trip of each robot, of the second, and so on."""
        ended = [[trip for trip in trips if len(trip) == 2] for trips in self.trips]
        most = max(map(len, ended))
        return [[trips[number] for trips in ended if number < len(trips)] for number in range(most)]


def explored(scenario, seed=0, **config):
    """A mission up to no frontier: environment, strategy, and what was done."""
    explorer = Noting(ExplorationConfig(**{"once": True, **config}))
    env = EntropyExploreEnv(scenario)
    times_s, shares = explore_until_done(env, explorer, seed)
    return env, explorer, (list(times_s), list(shares), mission_figures(env.missions, 0)["distance_m"])


def check_lazily_is_as_eagerly(monkeypatch, scenario, seed, **settings):
    """The same mission, for which fewer candidates are counted; returns what was done."""
    counted = []
    for kind in (VoxelFrontiers, TerrainFrontiers):
        monkeypatch.setattr(kind, "count", counting(kind.count, counted))
    _, lazy, done = explored(scenario, seed, **settings)
    lazily = sum(counted)
    monkeypatch.setattr(FrontierMap, "worths", eagerly)
    _, _, same = explored(scenario, seed, **settings)
    assert done == same and lazily < sum(counted) - lazily
    return lazy, done


def counting(count, counted):
    """`Candidates.count` that notes how many it counts."""

    def noted(self, voxels):
        counted.append(len(voxels))
        return count(self, voxels)

    return noted


@pytest.mark.parametrize(
    "metric", [{}, {"beta": 0.5}, {"bonus": 0.5}, {"metric": "nearest"}, {"metric": "coordinated"}]
)
@pytest.mark.parametrize("allocation", ["asynchronous", "synchronous"])
def test_lazily_is_as_eagerly_in_plans(monkeypatch, metric, allocation):
    settings = {**metric, "allocation": allocation}
    lazy, done = check_lazily_is_as_eagerly(monkeypatch, small_plan(), 1, **settings)
    assert all(lazy.idle) and done[1][-1] > 0.99


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"frontiers": FrontierConfig(gamma=None)},
        {"beta": 60.0},
        {"frontiers": FrontierConfig(visibility="naive")},
    ],
)
def test_lazily_is_as_eagerly_over_terrain(monkeypatch, settings):
    check_lazily_is_as_eagerly(monkeypatch, small_terrain(), 2, **settings)


@pytest.mark.parametrize("seed", [753, 89])
def test_bounds_stay_bounds_through_a_noisy_mission(monkeypatch, seed):
    """After every update no kept count is less than a new one, through walls that turn out free, too."""
    opened, levels, update = [], set(), VoxelFrontiers.update

    def checked(self, view, sigma):
        before = self._states.state.copy()
        update(self, view, sigma)
        opened.append(np.count_nonzero(before & COVERED > self._states.state & COVERED))
        levels.add(sigma)
        kept, voxels = self._bounds.copy(), self.listed(all_of_them=True)
        self.count(voxels)
        assert (kept >= self._bounds).all()
        self._bounds[:] = kept

    monkeypatch.setattr(VoxelFrontiers, "update", checked)
    noisy = {"max_range_m": 1.5, "angular_step_rad": math.pi / 90, "scan_time_s": 2.0, "range_noise_m": 0.3}
    explored(small_plan(sensor=noisy), seed, allocation="synchronous", once=False)
    assert max(opened) > 5 and len(levels) > 1


@pytest.mark.parametrize("allocation", ["asynchronous", "synchronous"])
def test_all_is_explored_with_lost_and_unheard_messages(allocation):
    """Decentralised: a third of the messages lost, none heard beyond 3 m, few measurements in each."""
    channel = {"burst": 30, "i_min_bits": 0.0, "loss_probability": 0.3, "range_m": 3.0}
    env, explorer, done = explored(small_plan(channel=channel), 4, allocation=allocation)
    assert all(explorer.idle) and done[1][-1] > 0.97
    assert mission_figures(env.missions, 0)["t_mission_s"] < 900.0


@pytest.mark.parametrize("allocation", ["asynchronous", "synchronous"])
def test_terrain_is_mapped_below_the_exposure_surface(allocation):
    env, explorer, done = explored(small_terrain(), 3, allocation=allocation)
    assert all(explorer.idle) and done[1][-1] > 0.97
    truth = env.missions.state.truth[0].reshape(env.missions.grid.shape)
    view = view_of(env.missions, 0, 0)
    assert view.ceiling is not None and not view.ceiling.flags.writeable
    layer = env.missions.grid.voxel_of(view.pose[:3])
    assert truth.sum(axis=2)[layer[0], layer[1]] <= layer[2] < view.ceiling[layer[0], layer[1]]
    assert env.missions.state.robots["blocked_moves"].sum() == 0


@pytest.mark.parametrize("navigator", ["straight", "planned"])
def test_synchronous_robots_over_terrain_wait_for_this_journey_and_no_other(navigator):
    """Who waits scans on the spot, 0.5 s each time: it leaves soon after the last one has scanned."""
    robot = {"reach_m": math.inf, "body_radius_m": 0.0, "navigator": navigator, "unknown_cost": 1e4}
    scenario = small_terrain(robots=3, robot=robot)
    _, explorer, _ = explored(scenario, 1, allocation="synchronous")
    late_s = []
    for before, after in itertools.pairwise(explorer.rounds()):
        ended_s = max(end for _, end in before)
        late_s += [left_s - ended_s for left_s, _ in after] if len(before) == len(after) == 3 else []
    assert len(late_s) >= 9
    assert np.mean(late_s) < 2.0 * scenario.kind_of(0).sensor.scan_time_s + 0.5


@pytest.mark.parametrize("scenario", [small_plan(), small_terrain()])
def test_where_a_robot_scanned_is_a_candidate_again_once_more_is_asked_for(scenario):
    env, explorer, _ = explored(scenario, 2)
    candidates = explorer._memories[0].cells
    view = view_of(env.missions, 0, 0)
    candidates.readmit()
    candidates.update(view, 0.5)
    before = set(candidates.listed().tolist())
    candidates.update(view, 1e-3)
    voxels = candidates.listed().tolist()
    assert voxels and set(voxels) - before
    candidates.exclude(voxels[0])
    assert voxels[0] not in candidates.listed()
    candidates.readmit()
    assert voxels[0] in candidates.listed()


def test_synchronous_robots_leave_together():
    """No robot sets out on its next trip before all have ended their latest one."""
    _, explorer, _ = explored(small_plan(), 4, allocation="synchronous")
    found = explorer.rounds()
    assert len(found) > 5
    for before, after in itertools.pairwise(found):
        if len(before) == 3:
            ended_s = max(end for _, end in before)
            assert all(left_s >= ended_s - 1e-6 for left_s, _ in after)


def test_bodies_and_a_short_reach_explore_an_office():
    """The named scenario as it is: bodies of 0.3 m, 5 m of reach, a narrow channel."""
    env = EntropyExploreEnv(
        with_settings(scripted(find_scenario("office")), {"robots": 2, "track_truth": True})
    )
    explorer = PerTimeVisibility(ExplorationConfig(once=True))
    explore_until_done(env, explorer, 1)
    assert all(explorer.idle) or env.missions.over(0) is MissionEnd.MAPPED
    explored = joint_figures(env.missions, 0)["explored"]
    assert explored is not None and explored > 0.97


@pytest.mark.parametrize(
    ("kind", "settings", "field"),
    [
        (ExplorationConfig, {"beta": -1.0}, "ExplorationConfig.beta"),
        (ExplorationConfig, {"bonus": -0.1}, "ExplorationConfig.bonus"),
        (ExplorationConfig, {"beta": math.nan}, "ExplorationConfig.beta"),
        (ExplorationConfig, {"allocation": "central"}, "ExplorationConfig.allocation"),
        (ExplorationConfig, {"once": 1}, "ExplorationConfig.once"),
        (ExplorationConfig, {"promises": 1}, "ExplorationConfig.promises"),
        (ExplorationConfig, {"metric": None}, "ExplorationConfig.metric"),
        (ExplorationConfig, {"metric": "V/t"}, "ExplorationConfig.metric"),
        (PerTimeVisibility, {"config": "V/t"}, "config"),
        (FrontierConfig, {"spacing_m": 0.0}, "FrontierConfig.spacing_m"),
        (FrontierConfig, {"visibility": "all"}, "FrontierConfig.visibility"),
        (FrontierConfig, {"gamma": 1.5}, "FrontierConfig.gamma"),
    ],
)
def test_what_is_refused(kind, settings, field):
    with pytest.raises(SettingError) as raised:
        kind(**settings)
    assert raised.value.field == field
