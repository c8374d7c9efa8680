"""The gradient strategy's choice (Rocha04, eqs. 32-40) against the slow reference."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.viewpoints.gradient_candidates import steepest_viewpoint
from tests.reference import rocha04
from tests.reference.scenes import SHAPES, as_reference, drawn, random_belief, seeds


@drawn(60)
@given(st.sampled_from(SHAPES), seeds, st.sampled_from([0.0, 1.0, 2.0, 2.7]), st.booleans(), st.booleans())
def test_the_choice_is_that_of_the_equations(size, seed, reach, projected, centred):
    rng = np.random.default_rng(seed)
    mean, precision = random_belief(size, seed)
    position = rng.integers(0, size) + (0.5 if centred else rng.uniform(0.05, 0.95, 3))
    yaw, pitch = rng.uniform(-math.pi, math.pi), rng.uniform(-1.4, 1.4)
    axes = rocha04.motion_axes(yaw, pitch) if projected else None
    ranked = rocha04.choose(as_reference(mean, precision), position, reach, size, axes)
    viewpoint = np.full(5, 7.0)
    found = steepest_viewpoint(mean, precision, position, yaw, pitch, reach, projected, viewpoint)
    if not ranked or ranked[0].score == 0.0:
        assert not found
        assert (viewpoint == 7.0).all()
        return
    assert found
    voxel = tuple(int(n) for n in np.floor(viewpoint[:3]))
    assert viewpoint[:3].tolist() == [index + 0.5 for index in voxel]
    chosen = next(choice for choice in ranked if choice.voxel == voxel)
    assert chosen.score == pytest.approx(ranked[0].score, rel=1e-5)
    assert rocha04.gaze(*viewpoint[3:]) == pytest.approx(chosen.gaze, abs=1e-4)


def test_where_nothing_is_steep_there_is_no_choice():
    mean, precision = np.full((7, 11, 5), 0.5, np.float32), np.ones((7, 11, 5), np.float32)
    viewpoint = np.full(5, 7.0)
    position = np.array([3.5, 5.5, 2.5])
    assert not steepest_viewpoint(mean, precision, position, 0.3, 0.0, 2.0, False, viewpoint)
    assert (viewpoint == 7.0).all()
