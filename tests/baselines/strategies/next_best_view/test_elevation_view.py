"""Visibility and new information over elevation (eqs. 3 and 5), by a slow reference and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given

from baselines.strategies.next_best_view.elevation_view import (
    Camera,
    Ground,
    fill_new_information,
    fill_visibility,
    visibility,
)
from tests.reference import sujan
from tests.reference.scenes import drawn, seeds


def random_ground(seed, shape=(11, 7)):
    """Rough ground with some columns measured well, others not at all, and a camera above it."""
    rng = np.random.default_rng(seed)
    height = rng.uniform(0.0, 2.0, shape)
    sigma = rng.choice([0.05, 0.7], shape)
    measurements = rng.choice([0.0, 1.5, 9.0], shape)
    ground = Ground(height, sigma, measurements, rng.uniform(0.1, 1.0, shape))
    pose = np.array([*(rng.uniform(0.05, 0.95, 2) * shape), rng.uniform(2.0, 5.0), rng.uniform(-3, 3), 0.6])
    return ground, pose


@drawn(60)
@given(seeds)
def test_visibility_over_elevation_is_the_paper_s(seed):
    ground, pose = random_ground(seed)
    seen = np.empty(ground.height.shape)
    fill_visibility(ground, Camera(math.pi, math.pi, math.inf), pose, seen)
    for x, y in np.ndindex(*seen.shape):
        expected = sujan.visibility(ground.height, ground.sigma, pose[:3], x, y)
        assert seen[x, y] == pytest.approx(expected if expected >= 1e-3 else 0.0, abs=1e-3)


@drawn(60)
@given(seeds)
def test_new_information_over_elevation_is_the_paper_s(seed):
    ground, pose = random_ground(seed)
    poses, bits = np.stack([pose, pose + np.array([0.1, 0.2, 0.3, 0.4, -0.3])]), np.empty(2)
    fill_new_information(ground, Camera(0.7, 0.4, 6.0), 4.0, poses, bits)
    for given_pose, found in zip(poses, bits, strict=True):
        expected = sujan.elevation_information(*ground, 4.0, given_pose, (1.4, 0.8), 6.0)
        assert found == pytest.approx(expected, abs=0.02)


def test_a_wall_hides_what_is_behind_it_and_a_ray_along_its_top_is_even():
    height, sigma = np.zeros((9, 5)), np.full((9, 5), 0.1)
    camera = (8.5, 2.5, 4.0)
    ground = Ground(height, sigma, np.zeros((9, 5)), np.ones((9, 5)))
    assert visibility(ground, camera, 0, 2) == pytest.approx(1.0, abs=1e-4)
    height[4, 2] = 3.0
    assert visibility(ground, camera, 0, 2) == 0.0
    height[4, 2] = 2.0  # the ray's height in the middle of its way
    assert visibility(ground, camera, 0, 2) == pytest.approx(0.5)
    assert visibility(ground, camera, 4, 2) == pytest.approx(1.0, abs=1e-4)  # its own top hides nothing
