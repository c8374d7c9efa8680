"""Poses to choose among: what is drawn, and gazes all around."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.strategies.next_best_view.poses import drawn_poses, pose_distance, yaws_around


def test_yaws_show_all_around_and_poses_lie_where_they_are_drawn():
    assert yaws_around(math.pi / 2) == pytest.approx([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi])
    assert yaws_around(2.0 * math.pi) == [0.0] and len(yaws_around(0.0)) == 63
    drawn, gazes = drawn_poses(np.random.default_rng(3), np.array([4, 9]), 500, (-0.3, 0.2))
    assert set(drawn) == {4, 9} and gazes.shape == (500, 2)
    assert np.abs(gazes[:, 0]).max() == pytest.approx(math.pi, abs=0.1)
    assert (gazes[:, 1].min(), gazes[:, 1].max()) == pytest.approx((-0.3, 0.2), abs=0.01)


def test_the_distance_between_poses_by_hand():
    pose, viewpoint = np.array([1.0, 2.0, 0.5, 3.0, 0.0]), np.array([4.0, 6.0, 0.5, -3.0, 0.0])
    turn = 2.0 * math.pi - 6.0
    assert pose_distance(pose, viewpoint) == pytest.approx(math.sqrt(25.0 + turn**2))
    assert pose.tolist() == [1.0, 2.0, 0.5, 3.0, 0.0]
