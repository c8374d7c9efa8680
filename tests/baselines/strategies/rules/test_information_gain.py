"""The rule `information-gain`: gains are counted as far as the choice needs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.rules.information_gain import InformationGain
from entropy_explore_env.frontiers.blocks import NONE
from tests.planner.scenes import cell, random_plan, scene_of, varied
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds


@given(st.sampled_from([0.02, 0.2, 2.0]), st.sampled_from([0.1, 3.0]), seeds)
@drawn(30)
def test_counting_only_gains_that_may_be_best_changes_no_choice(weight, horizon, seed):
    """In one view after another: gains that were counted before bound those of a map that has grown."""
    rng = np.random.default_rng(seed)
    plan, robot = random_plan((31, 14), rng)
    scene = scene_of(plan, robot)
    for _ in range(3):
        picked = varied(InformationGain(), weight=weight, horizon=horizon).pick(scene)
        scene.paths.start(scene.here)
        scene.paths.extend(math.inf)
        voxels = scene.cells.listed(all_of_them=True)
        lengths = scene.paths.lengths_to(voxels)
        near = lengths <= horizon * scene.cells.reach
        if near.sum() > 1:
            worth = weight * scene.cells.reach * np.log1p(scene.cells.gains(voxels)) - lengths
            mine = np.flatnonzero(voxels == picked)
            assert len(mine) == 1 and worth[mine[0]] == pytest.approx(worth[near].max())
        elif np.isfinite(lengths).any():
            assert picked != NONE
        grown = plan == reference.UNKNOWN
        plan[grown & (rng.random(plan.shape) < 0.2)] = reference.FREE
        grown_view = scene_of(plan, robot).view
        scene.cells.update(grown_view, 0.5)
        scene.paths.start(scene.here)


def test_of_two_equally_near_frontiers_the_one_that_shows_more_is_taken_by_hand():
    """The robot stands at a corner; up its corridor one unknown cell before a wall, to the right five."""
    plan = np.full((16, 7), reference.WALL, np.int8)
    plan[5, 1:4] = plan[5:8, 1] = reference.FREE
    plan[5, 4] = plan[8:13, 1] = reference.UNKNOWN
    scene = scene_of(plan, (5, 1), block=1)
    up, right = (int(np.ravel_multi_index(place, plan.shape)) for place in ((5, 3), (7, 1)))
    assert scene.cells.gains(np.array([up, right], np.int32)).tolist() == [1.0, 5.0]
    assert InformationGain().pick(scene) == right


def test_beyond_the_horizon_the_nearest_frontier_is_taken():
    plan = np.full((30, 3), reference.WALL, np.int8)
    plan[1:28, 1] = reference.FREE
    plan[28, 1] = reference.UNKNOWN
    scene = scene_of(plan, (7, 1))
    assert cell(plan, varied(InformationGain(), horizon=0.1).pick(scene)) == (27, 1)
