"""The rating function of the paper, by hand and by a reference."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.strategies.next_best_view.rating import new_information, pose_distance, rating
from tests.reference import sujan


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
