"""Entropy of occupancy, beside the truncated normal distribution of SciPy."""

import math

import numpy as np
import pytest
from hypothesis import given
from scipy.stats import truncnorm

from entropy_explore_env.belief.entropy import LN2, fill_occupancy_entropy
from tests.reference.scenes import drawn, random_belief, seeds


def entropies(mean, precision):
    filled = np.full(len(mean), np.nan, np.float32)
    fill_occupancy_entropy(np.array(mean, np.float32), np.array(precision, np.float32), filled)
    return filled


@drawn(20)
@given(seeds)
def test_voxels_have_the_entropy_of_the_probability_that_they_are_occupied(seed):
    mean, precision = (values.reshape(-1) for values in random_belief((3, 4, 2), seed))
    expected = []
    for mu, sigma in zip(mean.astype(float), precision.astype(float) ** -0.5, strict=True):
        p = truncnorm.sf(0.5, -mu / sigma, (1.0 - mu) / sigma, mu, sigma)
        p = min(max(float(p), 1e-300), 1.0 - 1e-16)
        expected.append(-p * math.log(p) - (1.0 - p) * math.log(1.0 - p))
    assert entropies(mean, precision) == pytest.approx(expected, rel=1e-3, abs=2e-6)


def test_a_half_says_nothing_and_six_deviations_all():
    found = entropies([0.5, 0.5, 0.0, 1.0, 0.0], [0.001, 1e9, 145.0, 145.0, 143.0])
    assert found[:4].tolist() == [np.float32(LN2), np.float32(LN2), 0.0, 0.0]
    assert 0.0 < found[4] < 1e-7
