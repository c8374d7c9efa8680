"""What rules read off a scene: the best of some candidates."""

from __future__ import annotations

import numpy as np

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.planner.scene import best_of


def test_a_cell_as_good_as_the_target_does_not_replace_it():
    voxels, worth = np.array([4, 9, 2]), np.array([1.0, 3.0, 3.0])
    assert [best_of(voxels, worth, target) for target in (2, 9, 4)] == [2, 9, 9]
    assert best_of(voxels, np.full(3, -np.inf), 4) == NONE and best_of(voxels[:0], worth[:0], 4) == NONE
