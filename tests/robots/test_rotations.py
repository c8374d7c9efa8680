"""Rotations agree with each other, and with quarter turns by hand."""

import math

import numpy as np

from entropy_explore_env.robots.rotations import (
    directions_of,
    gaze_matrix,
    gaze_of,
    quaternion_matrix,
    quaternion_of,
    ray_directions,
    turned_by,
)

QUARTER = 0.5 * math.pi


def test_quarter_turns_by_hand():
    ahead = directions_of(np.array([0.0, QUARTER, 0.3]), np.array([0.0, 0.0, QUARTER]))
    assert np.allclose(ahead, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    assert np.allclose(turned_by(np.array([2.0, 1.0, 3.0]), QUARTER), [-1.0, 2.0, 3.0])
    assert np.allclose(turned_by(np.array([2.0, 1.0, 3.0, 3.0, 0.4]), QUARTER)[3:], [3.0 - 3 * QUARTER, 0.4])


def test_rays_are_column_by_column():
    yaws, pitches = np.array([-0.2, 0.0, 0.2]), np.array([-0.1, 0.1])
    rays = ray_directions(yaws, pitches, 0.5, 0.3)
    assert rays.shape == (6, 3)
    for number, ray in enumerate(rays):
        assert np.array_equal(ray, directions_of(0.5 + yaws[number // 2], 0.3 + pitches[number % 2]))


def test_quaternions_matrices_and_gazes_are_the_same_rotations():
    for yaw, pitch in np.random.default_rng(0).uniform(-1.5, 1.5, (20, 2)):
        matrix = gaze_matrix(yaw, pitch)
        assert np.allclose(quaternion_matrix(*quaternion_of(yaw, pitch)), matrix)
        assert np.allclose(matrix[:, 0], directions_of(yaw, pitch))
        assert np.allclose(gaze_of(matrix), [yaw, pitch])
