"""Next best views: what a view shows and is worth, by the paper's equations, and how robots map by it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from baselines.strategies import make_strategy
from baselines.strategies.next_best_view import expected_view
from baselines.strategies.next_best_view.expected_view import (
    extrapolated,
    look,
    new_scratch,
    new_view,
    occupancy_map,
    voxels_in_view,
)
from baselines.strategies.next_best_view.rating import UNCERTAINTY, new_information, pose_distance, rating
from baselines.strategies.rules.next_best_view import NextBestView, NextBestViewConfig
from baselines.strategies.rules.raster import Raster, RasterConfig
from entropy_explore_env.belief.elevation import completed
from entropy_explore_env.belief.fields import Belief, occupancy_probability
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.settings import Grid
from entropy_explore_env.viewpoints.evaluation import robot_model
from tests.missions.test_tick import toward
from tests.reference import rocha04, sujan
from tests.reference.scenes import drawn, seeds, started

SHAPES = [(7, 11, 5), (13, 9, 1)]
PRIOR = 30.0**-2
CHOICES = ("information", "most-unmapped", "least-mapped", "random")


def patchy_belief(shape, rng):
    """Mean and precision: free and covered voxels, half of all never measured."""
    mean = rng.choice([0.02, 0.4, 0.97], shape, p=[0.7, 0.1, 0.2]).astype(np.float32)
    precision = np.full(shape, 40.0, np.float32)
    unknown = rng.random(shape) < 0.5
    mean[unknown], precision[unknown] = 0.5, PRIOR
    return mean, precision


def scenario_of(shape, **sensor):
    view = (math.pi / 3, 0.0 if shape[2] == 1 else math.pi / 4)
    settings = {"field_of_view_rad": view, "angular_step_rad": math.pi / 24, "max_range_m": 2.5, **sensor}
    base = find_scenario("room" if shape[2] > 1 else "occlusions")
    return with_settings(base, {"grid": Grid(shape, 0.5), "world": "empty", "sensor": settings})


@drawn(60)
@given(st.sampled_from(SHAPES), seeds, st.booleans())
def test_what_a_view_shows_and_its_new_information_are_the_paper_s(shape, seed, stretched):
    rng = np.random.default_rng(seed)
    mean, precision = patchy_belief(shape, rng)
    scenario = scenario_of(shape)
    model = robot_model(scenario, scenario.kind_of(0), thinning=1)
    start = rng.uniform(0.1, 0.9, 3) + rng.integers(0, shape)
    yaw, pitch = rng.uniform(-math.pi, math.pi), rng.uniform(-0.7, 0.7) * (shape[2] > 1)
    yaws, pitches, reach = model.scan.yaws, model.scan.pitches, 5.0
    generic = [
        rocha04.is_generic(start, rocha04.gaze(yaw + a, pitch + b), shape, reach)
        for a in yaws
        for b in pitches
    ]
    assume(all(generic))

    interest = rng.choice([1.0, 0.25], mean.size).astype(np.float32)
    known = occupancy_map(Belief(mean.ravel(), precision.ravel(), shape), PRIOR, interest)
    scratch, view = new_scratch(mean.size, model.longest_ray + 1), new_view(mean.size)
    for _ in range(2):  # the second look forgets the first
        look(known, model.scan, np.array([*start, yaw, pitch]), stretched, scratch, view)

    theirs = sujan.voxels_in_view(mean, start, yaw, pitch, yaws, pitches, reach)
    never = {v for v in theirs if precision[v] <= np.float32(PRIOR)}
    assert view.counts.tolist() == [len(theirs) - len(never), len(never)]
    assert set(view.seen[: view.counts[1]]) == {int(np.ravel_multi_index(v, shape)) for v in never}
    expected = 0.0
    for voxels in (theirs - never, never):
        found = [
            occupancy_probability(float(mean[v]), float(precision[v])) if v not in never else 0.5
            for v in voxels
        ]
        if stretched:
            apart = [0.5 * np.linalg.norm(np.array(v) + 0.5 - start) for v in voxels]
            found = [sujan.stretched(p, d) for p, d in zip(found, apart, strict=True)]
        weights = [float(interest[np.ravel_multi_index(v, shape)]) for v in voxels]
        expected += sujan.new_information(found, weights, 60.0, not stretched)
    bits = new_information(view.shares, 60.0, None if stretched else UNCERTAINTY)
    assert bits == pytest.approx(expected, abs=1e-9)


@drawn(40)
@given(seeds, st.booleans())
def test_unknown_cells_of_a_plan_have_the_mean_occupancy_of_their_neighbours(seed, warm):
    rng = np.random.default_rng(seed)
    mean, precision = patchy_belief((13, 9, 1), rng)
    belief = Belief(mean.ravel(), precision.ravel(), (13, 9, 1))
    known = occupancy_map(belief, PRIOR, np.ones(mean.size, np.float32))
    assume(not known.unknown.all())
    before = rng.random(mean.size).astype(np.float32) if warm else None
    found = extrapolated(known, before, math.inf).occupancy.reshape(13, 9)
    theirs = sujan.neighbours_mean(
        known.occupancy.reshape(13, 9).astype(float), known.unknown.reshape(13, 9) == 0
    )
    np.testing.assert_allclose(found, theirs, atol=0.02)
    np.testing.assert_array_equal(found.ravel()[known.unknown == 0], known.occupancy[known.unknown == 0])


@pytest.mark.parametrize(("reach", "low", "high"), [(3.0, (5, 0), (16, 9)), (math.inf, (0, 0), (21, 9))])
def test_large_plans_are_extrapolated_no_farther_than_can_be_seen(monkeypatch, reach, low, high):
    """A patch of known cells at x = 9 … 11, y = 2 … 4: the window is 3 + 1 cells wider, within the plan."""
    shape = (21, 9, 1)
    mean, precision = np.full(shape, 0.5, np.float32), np.full(shape, PRIOR, np.float32)
    mean[9:12, 2:5], precision[9:12, 2:5] = np.linspace(0.1, 0.4, 9).reshape(3, 3, 1), 4.0
    known = occupancy_map(Belief(mean.ravel(), precision.ravel(), shape), PRIOR, np.ones(189, np.float32))
    assert known.unknown.sum() == 180
    whole = extrapolated(known, None, reach).occupancy.reshape(21, 9)
    monkeypatch.setattr(expected_view, "_WHOLE_CELLS", 188)
    found = extrapolated(known, None, reach).occupancy.reshape(21, 9)
    window = slice(low[0], high[0]), slice(low[1], high[1])
    measured = known.unknown.reshape(21, 9) == 0
    inside = completed(known.occupancy.reshape(21, 9)[window], measured[window], 0.01)
    np.testing.assert_array_equal(found[window], inside.astype(np.float32))
    outside = np.ones((21, 9), bool)
    outside[window] = False
    assert (found[outside] == 0.5).all() and outside.any() == (reach == 3.0)
    assert (whole != 0.5).all() and (whole == found).all() == (reach == math.inf)


def test_in_3_d_unknown_voxels_keep_one_half():
    mean, precision = patchy_belief((7, 11, 5), np.random.default_rng(2))
    known = occupancy_map(
        Belief(mean.ravel(), precision.ravel(), (7, 11, 5)), PRIOR, np.ones(385, np.float32)
    )
    assert (extrapolated(known, None, 3.0).occupancy[known.unknown == 1] == 0.5).all()


def test_ratings_by_hand():
    pose, viewpoint = np.array([1.0, 2.0, 0.5, 3.0, 0.0]), np.array([4.0, 6.0, 0.5, -3.0, 0.0])
    turn = 2.0 * math.pi - 6.0
    assert pose_distance(pose, viewpoint) == pytest.approx(math.sqrt(25.0 + turn**2))
    assert pose.tolist() == [1.0, 2.0, 0.5, 3.0, 0.0]
    assert rating(2.0, 0.5, 0.2) == pytest.approx(1.5 * 0.8)
    by_paper = sujan.rating(2.0, pose, viewpoint, 0.1, 0.04, 3.0, -0.2)
    costs = 0.1 * pose_distance(pose, viewpoint) + 3.0 * -0.2
    assert rating(2.0, costs, 0.04) == pytest.approx(by_paper)
    shares = np.zeros((2, 20))
    shares[1, 9] = 8.0  # an eighth of the largest view, at p = 0.475: 3 bits of 1/8, almost wholly uncertain
    assert new_information(shares, 64.0, None) == pytest.approx(3.0 / 8.0)
    assert new_information(shares, 64.0) == pytest.approx(0.99820 * 3.0 / 8.0, rel=1e-4)
    assert new_information(shares, 64.0, linear=True) == pytest.approx(0.99820 / 8.0, rel=1e-4)


def test_the_largest_view_is_a_sector_or_part_of_a_ball():
    scan = robot_model(scenario_of((7, 11, 5)), scenario_of((7, 11, 5)).kind_of(0), thinning=1).scan
    assert voxels_in_view(scan, (math.pi / 2, 0.0), True, 10_000) == pytest.approx(0.25 * math.pi * 25.0)
    ball = voxels_in_view(scan, (2.0 * math.pi, math.pi), False, 10_000)
    assert ball == pytest.approx(4.0 / 3.0 * math.pi * 125.0)
    assert voxels_in_view(scan, (2.0 * math.pi, math.pi), False, 77) == 77


def missions_of(**settings):
    small = {"grid": Grid((80, 90, 1), 0.5), "decision_period_s": None, "track_truth": True}
    missions = Missions(with_settings(find_scenario("occlusions"), {**small, **settings}))
    missions.reset(0, seed=3)
    return missions


def play(missions, strategy, decisions):
    """Chosen viewpoints, decision by decision, of a strategy in the first mission."""
    strategy.reset(missions.scenario, missions.strategy_generator(0))
    chosen = []
    for _ in range(decisions):
        team = missions.scenario.robots
        views = [view_of(missions, 0, robot) for robot in range(team)]
        deciding = [view for view in views if view.deciding]
        actions = np.zeros((1, team, 3))
        for view, viewpoint in zip(deciding, [strategy.choose(view) for view in deciding], strict=True):
            actions[0, view.robot] = view.action_for(viewpoint)
            chosen.append((view, viewpoint))
        missions.step(actions, np.zeros((1, team), np.int64))
    return chosen


def test_each_choice_takes_the_pose_that_is_best_by_its_own_measure(monkeypatch):
    """All draw the same poses in the same map: then they differ only in what they compare."""
    drawn_poses, worths = [], {}
    original, worth = NextBestView._drawn, NextBestView._worth

    def noted(self, view, free):
        drawn_poses.append(original(self, view, free))
        return drawn_poses[-1]

    def weighed(self, view, known, pose):
        found = worth(self, view, known, pose)
        worths.setdefault(self.config.choice, []).append((found, self._view.counts.copy()))
        return found

    monkeypatch.setattr(NextBestView, "_drawn", noted)
    monkeypatch.setattr(NextBestView, "_worth", weighed)
    firsts = {}
    for choice in CHOICES:
        chosen = play(missions_of(robot={"reach_m": math.inf}), NextBestView(NextBestViewConfig(choice)), 2)
        firsts[choice] = chosen[1][1]
    for choice, poses in zip(CHOICES, drawn_poses, strict=True):
        best = 0 if choice == "random" else int(np.argmax([w for w, _ in worths[choice]]))
        np.testing.assert_array_equal(firsts[choice], poses[best])
    assert [w for w, _ in worths["most-unmapped"]] == [c[1] for _, c in worths["most-unmapped"]]
    assert [w for w, _ in worths["least-mapped"]] == [-c[0] for _, c in worths["least-mapped"]]
    assert max(c[1] for _, c in worths["most-unmapped"]) > 100


@pytest.mark.parametrize(
    "name", ["next-best-view", "most-unmapped", "least-mapped", "random-known", "raster", "raster-fixed-yaw"]
)
def test_every_method_maps_with_and_without_a_reach_and_with_a_teammate(name):
    for settings in ({}, {"robot": {"reach_m": math.inf}}, {"robots": 2}):
        missions = missions_of(**settings)
        chosen = play(missions, make_strategy(name), 40)
        clock = missions.state.missions[0]
        assert clock["explored_visible"] / clock["visible"] > 0.1
        assert len({tuple(viewpoint) for _, viewpoint in chosen}) > 10


def test_raster_scans_a_lattice_row_by_row_in_all_directions():
    missions = missions_of(robot={"reach_m": math.inf}, sensor={"max_range_m": 10.0})
    chosen = play(missions, make_strategy("raster"), 13)[1:]
    places = [tuple(viewpoint[:2]) for _, viewpoint in chosen]
    assert {round((x - 2.75) / 5.0, 9) % 1 for x, _ in places} == {
        0.0
    }  # 5 m apart, half of that from the edge
    assert [places[4 * n : 4 * n + 4] == [places[4 * n]] * 4 for n in range(3)] == [True] * 3
    yaws = [float(viewpoint[3]) for _, viewpoint in chosen[:4]]
    assert yaws == pytest.approx([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi])
    three = play(missions_of(robot={"reach_m": math.inf}), Raster(RasterConfig(yaw_steps=3)), 4)[1:]
    turns = [float(viewpoint[3]) for _, viewpoint in three]
    assert turns == pytest.approx([0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0])


def test_more_yaw_steps_than_rays_around_are_refused_before_a_mission_begins():
    missions = missions_of(sensor={"angular_step_rad": math.pi / 6.0})
    Raster(RasterConfig(yaw_steps=12)).reset(missions.scenario, np.random.default_rng(0))
    Raster(RasterConfig(yaw_steps=13, turning=False)).reset(missions.scenario, np.random.default_rng(0))
    with pytest.raises(SettingError, match=r"RasterConfig.yaw_steps = 13: allowed is at most 12, the rays"):
        Raster(RasterConfig(yaw_steps=13)).reset(missions.scenario, np.random.default_rng(0))
    for wrong in (0, 2.0, True):
        with pytest.raises(SettingError, match=r"RasterConfig\.yaw_steps"):
            RasterConfig(yaw_steps=wrong)  # type: ignore[arg-type]


def test_what_should_have_been_seen_and_was_not_loses_interest():
    """A cell announced as visible that stays unknown keeps e^-β of the interest in it, each time."""
    missions = missions_of(robot={"reach_m": math.inf})
    strategy = NextBestView(NextBestViewConfig(interest_decay=0.7))
    play(missions, strategy, 2)
    memory, view = strategy._memories[0], view_of(missions, 0, 0)
    unknown = np.flatnonzero(view.precision.ravel() <= np.float32(PRIOR))[:5].astype(np.int32)
    known = np.flatnonzero(view.precision.ravel() > np.float32(PRIOR))[:3].astype(np.int32)
    memory.goal, memory.expected = view.pose.copy(), np.concatenate([unknown, known])
    before = memory.interest.copy()
    strategy.choose(view)
    assert memory.interest[unknown] == pytest.approx(sujan.interest(before[unknown], 1.0, 0.7))
    np.testing.assert_array_equal(memory.interest[known], before[known])


def test_settings_out_of_range_are_named():
    for bad in (
        {"choice": "x"},
        {"poses": 0},
        {"distance_weight": -1.0},
        {"measure": 3},
        {"interest_decay": math.nan},
    ):
        with pytest.raises(SettingError, match=f"NextBestViewConfig.{next(iter(bad))}"):
            NextBestViewConfig(**bad)
    with pytest.raises(SettingError, match=r"RasterConfig\.spacing"):
        RasterConfig(spacing=0.0)


def drifting_mission(error_weight, drift=0.05):
    """How unsure of its pose a robot is over 16 decisions in a hall with two landmarks, and its choices."""
    task = with_settings(
        scenario_of((25, 21, 1)),
        {
            "robots": 1,
            "robot": {"localization": {"xy_m_per_sqrt_m": drift, "yaw_rad_per_sqrt_m": 0.2 * drift}},
            "sensor": {"max_range_m": 4.0},
            "fiducials": {"positions_m": ((0.6, 5.0, 0.25), (12.0, 5.0, 0.25))},
        },
    )
    missions, unsure, chosen = started(task, 3), 0.0, []
    strategy = NextBestView(NextBestViewConfig(error_weight=error_weight, distance_weight=0.0))
    strategy.reset(task, np.random.default_rng(4))
    for _ in range(16):
        view = view_of(missions, 0, 0)
        chosen.append(strategy.choose(view))
        toward(missions, chosen[-1])
        unsure += float(np.trace(view_of(missions, 0, 0).covariance))
    return unsure, chosen


def test_who_weighs_the_localization_error_knows_its_pose_better():
    careless, careful = drifting_mission(0.0)[0], drifting_mission(50.0)[0]
    assert 0.0 < careful < 0.7 * careless


def test_exact_robots_have_no_localization_error():
    chosen = [drifting_mission(weight, drift=0.0)[1] for weight in (0.0, 50.0)]
    assert (np.array(chosen[0]) == np.array(chosen[1])).all()


def test_a_weight_of_the_localization_error_below_0_is_refused():
    with pytest.raises(SettingError, match=r"error_weight.*-0\.1"):
        NextBestViewConfig(error_weight=-0.1)


def test_who_is_stopped_by_a_teammate_of_whom_it_never_heard_goes_on():
    task = with_settings(
        scenario_of((25, 21, 1)), {"robots": 2, "channel": {"burst": 0, "announcements": False}}
    )
    missions, strategy = started(task, 3), NextBestView(NextBestViewConfig())
    strategy.reset(task, np.random.default_rng(4))
    toward(missions, *[strategy.choose(view_of(missions, 0, robot)) for robot in range(2)])
    view = view_of(missions, 0, 0)
    assert all(seen.heard_s < 0.0 for seen in view.teammates.values())
    stopped = dataclasses.replace(view, move_end=MoveEnd.TEAMMATE)
    for _ in range(4):
        chosen = strategy.choose(stopped)
        assert np.isfinite(chosen).all() and np.linalg.norm(chosen[:3] - view.pose[:3]) > 0.0
