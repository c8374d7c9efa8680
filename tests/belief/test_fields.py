"""The entropy gradient (Rocha04, eq. 30) against the slow reference, and what known voxels leave of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.fields import entropy_gradient, remaining_bits, remaining_entropy_gradient
from tests.reference import rocha04
from tests.reference.scenes import SHAPES, as_reference, drawn, random_belief, seeds


@drawn(30)
@given(st.sampled_from(SHAPES), seeds, st.floats(0.05, 2.0))
def test_the_gradient_is_that_of_equation_30(size, seed, voxel_size_m):
    mean, precision = random_belief(size, seed)
    beliefs = as_reference(mean, precision)
    rng = np.random.default_rng(seed)
    for voxel in [(0, 0, 0), tuple(n - 1 for n in size), *rng.integers(0, size, (6, 3)).tolist()]:
        i, j, k = voxel
        expected = rocha04.entropy_gradient(lambda v: beliefs[v][1], (i, j, k), voxel_size_m)
        ours = entropy_gradient(precision, i, j, k, voxel_size_m)
        assert list(ours) == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_the_gradient_of_stripes():
    """σ = 2^(x - 2y + 3z), half a metre a voxel: 2, -4 and 6 bits a metre."""
    x, y, z = np.ogrid[0:7, 0:11, 0:5]
    precision = (4.0 ** -(x - 2 * y + 3 * z)).astype(np.float32)
    assert entropy_gradient(precision, 2, 3, 4, 0.5) == pytest.approx((2.0, -4.0, 6.0))
    assert entropy_gradient(precision, 0, 3, 4, 0.5) == pytest.approx((0.0, -4.0, 6.0))
    assert entropy_gradient(precision, 2, 0, 0, 0.5) == pytest.approx((2.0, 0.0, 0.0))


def test_what_is_left_of_stripes_above_known_voxels():
    """Of σ = 2^(x - 2y + 3z), where σ = 1 is known: the exponent where it is > 0, and its gradient."""
    x, y, z = np.ogrid[0:7, 0:11, 0:5]
    precision = (4.0 ** -(x - 2 * y + 3 * z)).astype(np.float32)
    known = np.float32(1.0)
    assert remaining_bits(precision[2, 3, 4], known) == 8.0
    assert remaining_bits(precision[0, 3, 0], known) == 0.0
    for voxel, expected in (
        ((2, 3, 4), (1.0, -2.0, 3.0)),
        ((1, 0, 0), (1.0, 0.0, 0.0)),
        ((2, 1, 0), (0.0, -2.0, 0.0)),  # known, beside one of 2 bits
        ((0, 2, 1), (0.0, -1.0, 0.0)),  # known, beside one of 1 bit
        ((0, 1, 1), (0.0, -2.0, 1.0)),  # above a known one
        ((0, 3, 0), (0.0, 0.0, 0.0)),
    ):
        assert remaining_entropy_gradient(precision, *voxel, known) == expected
