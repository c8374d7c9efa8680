"""New information and distances of the paper, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.strategies.next_best_view.rating import new_information, pose_distance


def test_distances_and_new_information_by_hand():
    pose, viewpoint = np.array([1.0, 2.0, 0.5, 3.0, 0.0]), np.array([4.0, 6.0, 0.5, -3.0, 0.0])
    turn = 2.0 * math.pi - 6.0
    assert pose_distance(pose, viewpoint) == pytest.approx(math.sqrt(25.0 + turn**2))
    assert pose.tolist() == [1.0, 2.0, 0.5, 3.0, 0.0]
    shares = np.zeros((2, 20))
    shares[1, 9] = 8.0  # an eighth of the largest view, at p = 0.475: 3 bits of 1/8, almost wholly uncertain
    assert new_information(shares, 64.0, None) == pytest.approx(3.0 / 8.0)
    assert new_information(shares, 64.0) == pytest.approx(0.99820 * 3.0 / 8.0, rel=1e-4)
    assert new_information(shares, 64.0, linear=True) == pytest.approx(0.99820 / 8.0, rel=1e-4)
