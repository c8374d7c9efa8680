"""Fractal noise: normal, self-affine with the exponent asked for, in any number of axes."""

from __future__ import annotations

import numpy as np
import pytest

from entropy_explore_env.worlds.recipes.fractal import fractal_noise


@pytest.mark.parametrize("hurst", [0.3, 0.5, 0.8])
def test_differences_grow_with_distance_as_the_exponent_says(hurst):
    """E (f(x + 2d) − f(x))² = 2^2H E (f(x + d) − f(x))², over 40 fields, between 2 and 16 voxels."""
    squares = np.zeros(4)
    for seed in range(40):
        field = fractal_noise((128, 96), hurst, np.random.default_rng(seed))
        squares += [np.mean((field[d:] - field[:-d]) ** 2) for d in (2, 4, 8, 16)]
    exponents = 0.5 * np.log2(squares[1:] / squares[:-1])
    assert exponents == pytest.approx(hurst, abs=0.13)


@pytest.mark.parametrize("shape", [(7, 11, 5), (9, 6), (13,), (1, 8), (3, 1, 4)])
def test_mean_and_spread(shape):
    field = fractal_noise(shape, 0.6, np.random.default_rng(1))
    assert field.shape == shape and field.dtype == np.float64
    assert field.mean() == pytest.approx(0.0, abs=1e-12)
    assert field.std() == pytest.approx(1.0)


def test_opposite_edges_do_not_match():
    gaps = []
    for seed in range(20):
        field = fractal_noise((64, 48), 0.8, np.random.default_rng(seed))
        gaps.append([np.abs(field[0] - field[-1]).mean(), np.abs(field[0] - field[1]).mean()])
    across, beside = np.mean(gaps, axis=0)
    assert across > 4.0 * beside


def test_a_single_value_is_zero():
    assert fractal_noise((1, 1), 0.5, np.random.default_rng(0)).tolist() == [[0.0]]
