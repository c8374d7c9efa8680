"""Tours through frontier cells, by hand."""

from __future__ import annotations

import numpy as np

from entropy_explore_env.planner.tour import Tour
from tests.planner.scenes import cell, corridor, scene_of, varied


def test_a_tour_of_both_ends_begins_with_the_nearer_and_keeps_its_target_when_that_is_as_good():
    plan = corridor()
    assert cell(plan, varied(Tour(), near=1.5, cover=0.5).pick(scene_of(plan, (8, 1)))) == (1, 1)
    assert cell(plan, varied(Tour(), near=1.5, cover=0.5).pick(scene_of(plan, (20, 1)))) == (27, 1)
    right = int(np.ravel_multi_index((27, 1), plan.shape))
    near_middle = scene_of(plan, (13, 1), target=right)
    assert cell(plan, varied(Tour(), near=1.5, cover=0.5, stay=0.2).pick(near_middle)) == (27, 1)
    restless = varied(Tour(), near=1.5, cover=0.5, stay=0.0)
    assert cell(plan, restless.pick(scene_of(plan, (13, 1), target=right))) == (1, 1)
