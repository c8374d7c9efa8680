"""What a scan is expected to show: by a slow reference of the paper's equations, and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from baselines.strategies.next_best_view import expected_view
from baselines.strategies.next_best_view.expected_view import (
    extrapolated,
    look,
    new_information,
    new_view,
    occupancy_map,
    voxels_in_view,
)
from entropy_explore_env.belief.elevation import completed
from entropy_explore_env.belief.fields import Belief, occupancy_probability
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import find_scenario
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.viewpoints.evaluation import robot_model
from tests.reference import rocha04, sujan
from tests.reference.scenes import drawn, seeds

SHAPES = [(7, 11, 5), (13, 9, 1)]
PRIOR = 30.0**-2


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
@given(st.sampled_from(SHAPES), seeds)
def test_what_a_view_shows_and_its_new_information_are_the_paper_s(shape, seed):
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
    view = new_view(mean.size, model.longest_ray)
    for _ in range(2):  # the second look forgets the first
        look(known, model.scan, np.array([*start, yaw, pitch]), view)

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
        weights = [float(interest[np.ravel_multi_index(v, shape)]) for v in voxels]
        expected += sujan.new_information(found, weights, 60.0)
    assert new_information(view.shares, 60.0) == pytest.approx(expected, abs=1e-9)


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


def test_the_largest_view_is_a_sector_or_part_of_a_ball():
    plan, volume = Grid((100, 90, 1), 0.5), Grid((40, 50, 60), 0.5)
    sector = RangeSensor((math.pi / 2, 0.0), math.pi / 24, max_range_m=2.5)
    ball = RangeSensor((2.0 * math.pi, math.pi), math.pi / 24, max_range_m=2.5)
    assert voxels_in_view(sector, plan) == pytest.approx(0.25 * math.pi * 25.0)
    assert voxels_in_view(ball, volume) == pytest.approx(4.0 / 3.0 * math.pi * 125.0)
    assert voxels_in_view(ball, Grid((7, 11, 1), 0.5)) == 77


def test_new_information_by_hand():
    shares = np.zeros((2, 20))
    shares[1, 9] = 8.0  # an eighth of the largest view, at p = 0.475: 3 bits of 1/8, almost wholly uncertain
    assert new_information(shares, 64.0) == pytest.approx(0.99820 * 3.0 / 8.0, rel=1e-4)
