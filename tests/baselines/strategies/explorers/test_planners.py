"""The planners that look ahead, tours and trees, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from baselines.strategies.rules import receding_horizon
from baselines.strategies.rules.receding_horizon import RecedingHorizon
from entropy_explore_env.planner.tour import Tour
from tests.baselines.strategies.explorers.scenes import cell, corridor, random_plan, scene_of, varied
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds


def test_a_tour_of_both_ends_begins_with_the_nearer_and_keeps_its_target_when_that_is_as_good():
    plan = corridor()
    assert cell(plan, varied(Tour(), near=1.5, cover=0.5).pick(scene_of(plan, (8, 1)))) == (1, 1)
    assert cell(plan, varied(Tour(), near=1.5, cover=0.5).pick(scene_of(plan, (20, 1)))) == (27, 1)
    right = int(np.ravel_multi_index((27, 1), plan.shape))
    near_middle = scene_of(plan, (13, 1), target=right)
    assert cell(plan, varied(Tour(), near=1.5, cover=0.5, stay=0.2).pick(near_middle)) == (27, 1)
    restless = varied(Tour(), near=1.5, cover=0.5, stay=0.0)
    assert cell(plan, restless.pick(scene_of(plan, (13, 1), target=right))) == (1, 1)


def test_lengths_between_places_are_those_of_paths_by_hand():
    """A corridor: from cell 8 to both ends 7 and 19, and 26 between them."""
    plan = corridor()
    scene = scene_of(plan, (8, 1))
    ends = np.array([np.ravel_multi_index(place, plan.shape) for place in ((1, 1), (27, 1))], np.int32)
    found = scene.paths.lengths_between(ends, np.array([7.0, 19.0]))
    assert found == pytest.approx(np.array([[0, 7, 19], [7, 0, 26], [19, 26, 0]], float))


@given(seeds)
@drawn(30)
def test_lengths_between_places_are_the_shortest(seed):
    rng = np.random.default_rng(seed)
    plan, robot = random_plan((31, 14), rng)
    scene = scene_of(plan, robot)
    reached = np.argwhere(np.isfinite(reference.lengths_from(plan, robot)))
    places = [tuple(map(int, place)) for place in reached[rng.integers(len(reached), size=4)]]
    voxels = np.array([np.ravel_multi_index(place, plan.shape) for place in places], np.int32)
    fields = reference.lengths_from_all(plan, [robot, *places])
    wanted = np.array([[field[place] for place in (robot, *places)] for field in fields])
    found = scene.paths.lengths_between(voxels, scene.paths.lengths_from(scene.here, voxels))
    assert found == pytest.approx(wanted, rel=1e-5, abs=1e-5)


def test_a_tree_leads_to_where_something_is_unknown_and_else_to_the_nearest_frontier(monkeypatch):
    plan = np.full((40, 5), reference.WALL, np.int8)
    plan[1:30, 1:4] = reference.FREE
    plan[30:38, 1:4] = reference.UNKNOWN
    scene = scene_of(plan, (15, 2))
    monkeypatch.setattr(receding_horizon, "_EDGE", 0.1)
    planner = RecedingHorizon()
    planner.reset(scene.view.scenario, np.random.default_rng(5))
    x, _ = cell(plan, planner.pick(scene))
    assert x != 15 and plan[cell(plan, planner.pick(scene_of(plan, (15, 2))))] == reference.FREE
    monkeypatch.setattr(receding_horizon, "_LEAST_GAIN", 1e9)
    none = RecedingHorizon()
    none.reset(scene.view.scenario, np.random.default_rng(5))
    assert cell(plan, none.pick(scene_of(plan, (15, 2)))) == (29, 2)
