"""The rule `distance-advantage` in random plans, beside the textbook's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.rules.distance_advantage import DistanceAdvantage, advantages
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.voxel_frontiers import BLOCK
from tests.planner.scenes import cell, random_plan, scene_of, varied
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds

SHAPES = ((17, 11), (9, 23), (31, 14))


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
