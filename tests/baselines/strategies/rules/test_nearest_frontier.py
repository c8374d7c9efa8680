"""The rule `nearest-frontier` in random plans, beside the textbook's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.rules.nearest_frontier import NearestFrontier
from entropy_explore_env.frontiers.blocks import NONE
from tests.planner.scenes import cell, random_plan, scene_of
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
