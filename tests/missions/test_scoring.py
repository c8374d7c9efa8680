"""Figures that are carried along equal those of the whole map, and nobody acts on them."""

import math

import numpy as np
import pytest
from hypothesis import given

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.missions.records import PROGRESS, MissionEnd
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import joint_figures, mission_figures
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import drawn, free_box, put, random_actions, seeds, started, wander

NOISY = {"sensor": {"range_noise_m": 0.2, "max_range_m": 2.0}, "channel": {"loss_probability": 0.4}}


@pytest.mark.parametrize("settings", [{}, NOISY, {"world": "furnished"}], ids=["box", "noisy", "furnished"])
def test_the_joint_map_is_scored_as_if_it_were_looked_at_whole(settings):
    missions = started(free_box(track_truth=True, **settings), seed=4)
    clock, state = missions.state.missions[0], missions.state
    assert (clock["explored"], clock["error"], clock["wrong"]) == (0, 0.0, 0)
    for step in range(5):
        wander(missions, 12, step)
        mean, precision, truth = state.joint_mean[0], state.joint_precision[0], state.truth[0]
        measured = precision > missions.rules.params[0]["prior_precision"]
        whole = map_entropy_bits(precision.reshape(1, *missions.grid.shape))[0]
        assert clock["joint_bits"] == pytest.approx(whole, rel=1e-6)
        assert clock["explored"] == measured.sum() > 0
        assert clock["explored_visible"] == (measured & state.visible[0]).sum()
        assert clock["error"] == pytest.approx(np.abs(mean - truth)[measured].sum(dtype=np.float64), rel=1e-6)
        assert clock["wrong"] == ((mean > 0.5) != (truth > 0.5))[measured].sum()
    figures = joint_figures(missions, 0)
    assert 0.0 < (figures["explored"] or 0.0) <= 1.0
    assert figures["entropy_bits"] == clock["joint_bits"]


def test_the_joint_map_knows_what_all_robots_measured_and_no_more():
    """Without a channel it is the product of all robots' maps, one prior counted once."""
    missions = started(free_box(track_truth=True, channel={"burst": 0}), seed=2)
    wander(missions, 30, 0)
    state, prior = missions.state, missions.rules.params[0]["prior_precision"]
    together = state.precision[0].astype(np.float64).sum(axis=0) - (missions.scenario.robots - 1) * prior
    np.testing.assert_allclose(state.joint_precision[0], together, rtol=1e-5)
    assert state.missions[0]["joint_bits"] <= state.robots[0]["entropy_bits"].min()


def test_nobody_acts_on_the_score():
    plain, scored = (started(free_box(track_truth=flag), seed=3) for flag in (False, True))
    for missions in (plain, scored):
        wander(missions, 40, 1)
    assert plain.state.joint_mean.shape == plain.state.visible.shape == (1, 0)
    np.testing.assert_array_equal(plain.state.mean, scored.state.mean)
    np.testing.assert_array_equal(plain.observations, scored.observations)
    for field in ("entropy_bits", "gained_bits", "heard_bits", "redundant", "goal"):
        np.testing.assert_array_equal(plain.state.robots[field], scored.state.robots[field])


def test_times_on_the_way_are_those_of_the_best_map():
    missions = started(free_box(ending={"sigma_end": 2.0}), seed=5)
    clock, robots = missions.state.missions[0], missions.state.robots[0]
    asked = clock["entropy_start_bits"] - clock["entropy_end_bits"]
    expected, rng = [-1.0] * len(PROGRESS), np.random.default_rng(0)
    assert clock["reached_s"].tolist() == expected
    for _ in range(2000):
        missions.step(*random_actions(missions, rng))
        share = (clock["entropy_start_bits"] - robots["entropy_bits"].min()) / asked
        for mark, least in enumerate(PROGRESS):
            if expected[mark] < 0.0 and share >= least:
                expected[mark] = float(clock["time_s"])
        if clock["end"]:
            break
    assert clock["reached_s"].tolist() == expected
    assert 0.0 < expected[0] < expected[1] < expected[2] <= expected[3] == clock["time_s"]


def plan(seed: int) -> np.ndarray:
    """Solid voxels (9, 13, 1) of a plan, drawn so that pockets, diagonal gaps and lone pillars occur."""
    return np.random.default_rng(seed).random((9, 13, 1)) < 0.35


@drawn(10)
@given(seeds)
def test_in_a_plan_what_can_be_seen_is_what_a_scanner_in_all_places_sees(seed):
    """Free voxels and walls, none more and none fewer: 100 % can be reached, and not before all is seen."""
    scenario = free_box(
        grid=Grid((9, 13, 1), 0.5),
        robots=1,
        sensor={"field_of_view_rad": (2 * math.pi, 0.0), "angular_step_rad": math.pi / 360},
        ending={"seen_share": 1.0},
    )
    world = World(scenario.grid, plan(seed), "plan")
    missions = Missions(scenario, given=[world])
    missions.reset(0, seed)
    state, clock = missions.state, missions.state.missions[0]
    places = world.layout(scenario).starts
    rng = np.random.default_rng(seed)
    for voxel in rng.permutation(places):
        assert missions.over(0) is MissionEnd.RUNNING
        x, y, _ = np.unravel_index(voxel, scenario.grid.shape)
        put(missions, 0, (0.5 * x + 0.25, 0.5 * y + 0.25, 0.25, 0.0, 0.0))
        stay = view_of(missions, 0, 0).action_for(state.robots[0, 0]["goal"])
        missions.step(np.array([[stay]]), np.zeros((1, 1), np.int64))
        measured = state.joint_precision[0] > missions.rules.params[0]["prior_precision"]
        assert not (measured & ~state.visible[0]).any()
        assert clock["explored_free"] == (measured & state.visible[0] & (state.truth[0] == 0.0)).sum()
        if missions.over(0) is not MissionEnd.RUNNING:
            break
    assert missions.over(0) is MissionEnd.SEEN
    assert (measured == state.visible[0]).all() and clock["explored_visible"] == clock["visible"]
    assert clock["explored_free"] == clock["visible_free"] == len(places)
    figures = mission_figures(missions, 0)
    assert figures["finished"] and figures["joint"]["unseen_free_voxels"] == 0


@pytest.mark.parametrize(
    "ending", [{"seen_share": 0.8}, {"unseen_free_voxels": 40}, {"seen_share": 0.8, "sigma_end": 20.0}]
)
def test_a_mission_ends_with_the_scan_that_shows_enough(ending):
    """Whatever its entropy is, and not a scan earlier; time and path at marks are those of their scans."""
    scenario = free_box(ending=ending, world="furnished", robots=2, sensor={"scan_every_m": 0.3})
    assert scenario.track_truth
    missions = started(scenario, seed=6)
    clock, robots = missions.state.missions[0], missions.state.robots[0]
    rng = np.random.default_rng(1)
    marks = {0.5: None, 0.9: None, 0.95: None, 0.99: None, 1.0: None}
    assert clock["seen_s"].tolist() == clock["seen_m"].tolist() == [-1.0] * 5
    while missions.over(0) is MissionEnd.RUNNING:
        share = clock["explored_visible"] / clock["visible"]
        unseen = clock["visible_free"] - clock["explored_free"]
        assert share < ending["seen_share"] if "seen_share" in ending else unseen > 40
        missions.step(*random_actions(missions, rng))
        for mark in marks:
            if marks[mark] is None and clock["explored_visible"] >= mark * clock["visible"]:
                marks[mark] = (float(clock["time_s"]), robots["distance_m"].sum())
    assert missions.over(0) is MissionEnd.SEEN
    reached = [mark for mark in marks.values() if mark is not None]
    assert 0 < len(reached) < 5
    for number, mark in enumerate(reached):
        # steps may hold several scans, so a mark may have been reached earlier in its step
        assert clock["seen_s"][number] <= mark[0] and clock["seen_m"][number] <= mark[1] + 1e-9
        assert number == 0 or clock["seen_s"][number] > reached[number - 1][0] - 1e-9
    assert clock["seen_s"][len(reached) :].tolist() == [-1.0] * (5 - len(reached))
    joint = mission_figures(missions, 0)["joint"]
    assert joint["t50_seen_s"] == clock["seen_s"][0] and joint["path50_seen_m"] == clock["seen_m"][0]
    assert joint["t100_seen_s"] is None and joint["path100_seen_m"] is None
    assert joint["driven_m"] == robots["distance_m"].sum()


def test_surfaces_without_return_stay_unknown_and_the_mission_ends_without_them():
    """A room with a glass wall: nobody maps the glass, and the ending does not ask for it."""
    grid = Grid((7, 11, 5), 0.5)
    solid = np.zeros(grid.shape, bool)
    solid[0] = True
    glass = np.zeros(grid.shape, bool)
    glass[0, 3:8] = True
    plain, glazed = World(grid, solid, "plain"), World(grid, solid, "glazed", unreadable=glass)
    missions = Missions(
        free_box(track_truth=True, ending={"seen_share": 1.0, "time_limit_s": 4000.0}), given=[glazed]
    )
    missions.reset(0, seed=1)
    clock, state = missions.state.missions[0], missions.state
    assert clock["visible"] == plain.visible_voxels(missions.scenario) - glass.sum()
    assert set(np.unique(state.truth[0])) == {0.0, 1.0, 2.0}
    wander(missions, 3000, 1)
    prior = missions.rules.params[0]["prior_precision"]
    precision = missions.precision[0]
    assert (precision[:, glass] == prior).all()
    assert (missions.state.joint_precision[0].reshape(grid.shape)[glass] == prior).all()
    assert (missions.state.joint_precision[0].reshape(grid.shape)[solid & ~glass] > prior).all()
    assert clock["end"] == MissionEnd.SEEN.code
    measured = state.joint_precision[0] > prior
    error = np.abs(state.joint_mean[0] - np.minimum(state.truth[0], 1.0))[measured].sum(dtype=np.float64)
    assert clock["error"] == pytest.approx(error, rel=1e-6)
