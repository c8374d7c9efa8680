"""Choices of the rules of exploration in random plans, beside the textbook's."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from baselines.strategies.rules.distance_advantage import DistanceAdvantage, advantages
from baselines.strategies.rules.information_gain import InformationGain
from baselines.strategies.rules.nearest_frontier import NearestFrontier, best_of
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.voxel_frontiers import BLOCK
from tests.baselines.strategies.explorers.scenes import belief_of_plan, cell, random_plan, scene_of, varied
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds

SHAPES = ((17, 11), (9, 23), (31, 14))


@given(st.sampled_from(SHAPES), seeds)
@drawn(60)
def test_the_nearest_frontier_cell_of_all_is_chosen(shape, seed):
    plan, robot = random_plan(shape, np.random.default_rng(seed))
    wanted = reference.nearest_frontier(plan, robot)
    picked = NearestFrontier().pick(scene_of(plan, robot))
    if not wanted:
        assert picked == NONE
    else:
        assert wanted[cell(plan, picked)] == pytest.approx(max(wanted.values()), abs=1e-6)


@given(st.sampled_from(SHAPES), st.sampled_from([3, 6, 40]), st.sampled_from([4.0, 9.0, math.inf]), seeds)
@drawn(40)
def test_advantages_are_the_textbooks_and_the_greatest_of_one_cell_a_block_is_chosen(
    shape, radius, horizon, seed
):
    plan, robot = random_plan(shape, np.random.default_rng(seed))
    scene = scene_of(plan, robot)
    wanted = reference.distance_advantage(plan, robot, radius, horizon)
    picked = varied(DistanceAdvantage(), radius=radius, horizon=horizon).pick(scene)
    if not wanted:
        assert picked == NONE
        return
    lengths = reference.lengths_from(plan, robot)
    nearest_in_block: dict[tuple[int, int], float] = {}
    for place in wanted:
        block = (place[0] // BLOCK, place[1] // BLOCK)
        nearest_in_block[block] = min(lengths[place], nearest_in_block.get(block, math.inf))
    stand = {
        p: v for p, v in wanted.items() if lengths[p] <= nearest_in_block[p[0] // BLOCK, p[1] // BLOCK] + 1e-6
    }
    x, y = cell(plan, picked)
    assert (x, y) in stand
    tied = {}  # of a block's equally near cells either may stand for it
    for p, v in stand.items():
        tied.setdefault((p[0] // BLOCK, p[1] // BLOCK), []).append(v)
    least = max(min(values) for values in tied.values())
    assert stand[x, y] >= least - 1e-6


@given(seeds)
@drawn(30)
def test_sparing_searches_changes_no_greatest_advantage(seed):
    plan, robot = random_plan((31, 14), np.random.default_rng(seed))
    scene = scene_of(plan, robot)
    voxels, lengths = scene.paths.frontiers_within(math.inf)
    if len(voxels) == 0:
        return
    around = scene.paths.around(scene.here, 12)
    worth = advantages(scene.paths, voxels, lengths, around)
    all_of_them = reference.distance_advantage(plan, robot, 12, math.inf)
    wanted = np.array([all_of_them[cell(plan, voxel)] for voxel in voxels])
    known = np.isfinite(worth)
    np.testing.assert_allclose(worth[known], wanted[known], atol=1e-6)
    assert worth.max() == pytest.approx(wanted.max(), abs=1e-6)


def test_of_two_equally_near_frontiers_the_one_far_from_all_else_is_taken_by_hand():
    """A corridor of 18 cells, 3 … 20; the robot in cell 5 is two steps from a frontier on either side.

    From cell 3 the others are 0 … 17 steps away, 8.5 on average; from cell 7 it is 101/18.
    """
    plan = np.full((22, 3), reference.WALL, np.int8)
    plan[3:21, 1] = reference.FREE
    plan[2, 1] = plan[7, 2] = reference.UNKNOWN
    wanted = reference.distance_advantage(plan, (5, 1), 60, 60.0)
    assert wanted == pytest.approx({(3, 1): 8.5 - 2.0, (7, 1): 101 / 18 - 2.0})
    assert cell(plan, DistanceAdvantage().pick(scene_of(plan, (5, 1)))) == (3, 1)


def test_a_cell_as_good_as_the_target_does_not_replace_it():
    voxels, worth = np.array([4, 9, 2]), np.array([1.0, 3.0, 3.0])
    assert [best_of(voxels, worth, target) for target in (2, 9, 4)] == [2, 9, 9]
    assert best_of(voxels, np.full(3, -np.inf), 4) == NONE and best_of(voxels[:0], worth[:0], 4) == NONE


def test_a_dropped_cell_counts_again_when_the_map_changes_around_it_only():
    plan = np.full((30, 7), reference.WALL, np.int8)
    plan[:, 3] = reference.FREE
    plan[0, 3] = plan[29, 3] = reference.UNKNOWN
    scene = scene_of(plan, (10, 3))
    left, right = (int(np.ravel_multi_index(place, plan.shape)) for place in ((1, 3), (28, 3)))
    assert NearestFrontier().pick(scene) == left
    scene.cells.drop(left, with_edges=True)
    assert NearestFrontier().pick(scene) == right and not scene.cells.is_frontier(left)
    for place, back in (((25, 2), False), ((2, 2), True)):
        plan[place] = reference.UNKNOWN
        mean, precision = belief_of_plan(plan)
        view = SimpleNamespace(mean=mean, precision=precision.copy(), scenario=scene.view.scenario)
        view.precision[place] = 200.0  # measured again, and free now
        view.mean[place] = 0.05
        scene.cells.update(view, 0.5)  # type: ignore[arg-type]
        assert scene.cells.is_frontier(left) == back


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
        _, voxels = scene.cells.listed(all_of_them=True)
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


@given(seeds)
@drawn(30)
def test_openings_are_the_connected_frontier_cells_of_the_textbook(seed):
    plan, robot = random_plan((23, 17), np.random.default_rng(seed))
    scene = scene_of(plan, robot)
    there = np.zeros(plan.shape, bool)
    for place in reference.frontier_cells(plan):
        there[place] = True
    labels, _ = ndimage.label(there, np.ones((3, 3)))
    for place in reference.frontier_cells(plan)[:5]:
        whole = int((labels == labels[place]).sum())
        voxel = int(np.ravel_multi_index(place, plan.shape))
        assert [scene.cells.opening(voxel, most) for most in (2, 5, 1000)] == [
            min(whole, m) for m in (2, 5, 1000)
        ]
