"""Beliefs seen from above and from the side, against sums written out."""

import math

import numpy as np
import pytest

from entropy_explore_env.reports.projection import projections, shares_left
from tests.reference.scenes import random_belief

SHAPE = (7, 11, 5)


def belief(shape: tuple[int, int, int] = SHAPE, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Shares of entropy, about half of them known, and coverage."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.6, 1.2, shape).clip(0, 1).astype(np.float32), rng.random(shape).astype(np.float32)


def by_hand(shares: list[float], covers: list[float]) -> tuple[float, float]:
    """Mean share and cubic mean of the known along one line of sight."""
    known = [c**3 for s, c in zip(shares, covers, strict=True) if s < 0.9]
    return sum(shares) / len(shares), (sum(known) / len(known)) ** (1 / 3) if known else -1.0


@pytest.mark.parametrize("shape", [SHAPE, (3, 2, 6), (1, 10, 3)])
def test_lines_of_sight_from_above_and_from_the_side(shape):
    share, coverage = belief(shape)
    above, side = projections(share, coverage)
    assert above.entropy.shape == above.coverage.shape == shape[:2]
    assert side.entropy.shape == side.coverage.shape == (shape[0], shape[2])
    for i, j in np.ndindex(*shape[:2]):
        seen = by_hand(share[i, j].tolist(), coverage[i, j].tolist())
        assert (above.entropy[i, j], above.coverage[i, j]) == pytest.approx(seen, abs=1e-6)
    for i, k in np.ndindex(shape[0], shape[2]):
        seen = by_hand(share[i, :, k].tolist(), coverage[i, :, k].tolist())
        assert (side.entropy[i, k], side.coverage[i, k]) == pytest.approx(seen, abs=1e-6)


def test_a_plan_is_shown_as_it_is():
    share, coverage = belief((9, 6, 1))
    (plan,) = projections(share, coverage)
    np.testing.assert_array_equal(plan.entropy, share[:, :, 0])
    np.testing.assert_array_equal(plan.coverage, np.where(share < 0.9, coverage, -1.0)[:, :, 0])


def test_the_top_of_a_box_shows_and_a_hall_between_floor_and_ceiling_does_not_look_like_a_wall():
    share, cover = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.float32)
    cover[1, 1, 2] = 1.0  # a box: its top is known, what is below it is not
    share[1, 1, :2] = 1.0
    cover[2, 2] = 1.0  # a wall
    cover[3, 3, [0, 4]] = 1.0  # a hall
    above = projections(share, cover)[0].coverage
    assert above[1, 1] == pytest.approx((1 / 3) ** (1 / 3)) and above[3, 3] == pytest.approx(0.4 ** (1 / 3))
    assert above[2, 2] == 1.0 and above[0, 0] == 0.0


def test_shares_are_linear_in_the_logarithm_of_sigma():
    _, precision = random_belief(SHAPE, 3)
    prior, known = 30.0**-2, 0.03**-2
    shares = shares_left(precision, prior, known)
    assert (shares.shape, shares.dtype) == (SHAPE, np.float32)
    for voxel in np.ndindex(*SHAPE):
        sigma = float(precision[voxel]) ** -0.5
        left = math.log(sigma / 0.03) / math.log(30.0 / 0.03)
        assert shares[voxel] == pytest.approx(min(max(left, 0.0), 1.0), abs=1e-6)
    assert ((shares > 0.0) & (shares < 1.0)).any()
