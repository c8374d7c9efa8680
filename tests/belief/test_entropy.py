"""Entropy of occupancy, beside the truncated normal distribution of SciPy."""

import math

import numpy as np
import pytest
from scipy.stats import truncnorm

from entropy_explore_env.belief.entropy import LN2, fill_occupancy_entropy


def entropies(mean, precision):
    filled = np.full(len(mean), np.nan, np.float32)
    fill_occupancy_entropy(np.array(mean, np.float32), np.array(precision, np.float32), filled)
    return filled


def test_voxels_between_free_and_occupied_have_the_entropy_of_their_probability():
    mean, precision = [0.1, 0.4, 0.55, 0.9, 1.0], [2.0, 100.0, 25.0, 0.01, 30.0]
    expected = []
    for mu, sigma in zip(np.float32(mean), np.float32(precision) ** -0.5, strict=True):
        p = truncnorm.sf(0.5, -mu / sigma, (1.0 - mu) / sigma, mu, sigma)
        expected.append(-p * math.log(p) - (1.0 - p) * math.log(1.0 - p))
    assert entropies(mean, precision) == pytest.approx(expected, rel=1e-3)


def test_a_half_says_nothing_and_six_deviations_all():
    found = entropies([0.5, 0.5, 0.0, 1.0, 0.0], [0.001, 1e9, 145.0, 145.0, 143.0])
    assert found[:4].tolist() == [np.float32(LN2), np.float32(LN2), 0.0, 0.0]
    assert 0.0 < found[4] < 1e-7
