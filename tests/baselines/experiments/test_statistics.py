"""Statistics against values worked out by hand, slow references, SciPy, and what must not change them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from baselines.experiments import statistics
from baselines.experiments.statistics import (
    double_ratio_interval,
    holm,
    improvement_interval,
    interpolated_ratio_interval,
    interquartile_mean,
    iqm_interval,
    mean_interval,
    median_interval,
    median_ratio_interval,
    paired_p,
    performance_profile,
    ratio_interval,
    small_mean_range,
)
from tests.reference.scenes import drawn

RNG = np.random.default_rng(3)
OURS, THEIRS = RNG.gamma(3.0, 100.0, (3, 7)), RNG.gamma(4.0, 100.0, (3, 7))
SCORES = arrays(
    float, st.tuples(st.integers(1, 4), st.integers(1, 9)), elements=st.integers(1, 40).map(float)
)


def assert_alike(ours, theirs, share=0.06):
    """Ends of intervals agree up to a small share of the width: both draw at random."""
    assert ours == pytest.approx(theirs, abs=share * (theirs[1] - theirs[0]))


# --- interquartile mean


def test_the_interquartile_mean_worked_out_by_hand():
    assert interquartile_mean(np.array([100.0, 2.0, 1.0, 4.0])) == 3.0  # 2 and 4 are left
    assert interquartile_mean(np.array([1.0, 2.0, 3.0, 4.0, 5.0])) == 3.0  # 5 // 4 = 1 of each end goes
    assert interquartile_mean(np.array([1.0, 2.0, 9.0])) == 4.0  # of three, none
    assert interquartile_mean(np.array([7.0])) == 7.0
    rows = np.array([[0.0, 0.0, 1.0, 5.0], [8.0, 6.0, 4.0, 2.0]])
    assert interquartile_mean(rows).tolist() == [0.5, 5.0]


@drawn()
@given(SCORES)
def test_the_interquartile_mean_is_scipy_s(scores):
    assert iqm_interval(scores).value == pytest.approx(stats.trim_mean(scores, 0.25, axis=None))


@drawn()
@given(SCORES, st.randoms(use_true_random=False), st.integers(2, 5))
def test_order_and_unit_do_not_matter_to_the_mean(scores, random, unit):
    shuffled = scores.ravel().copy()
    random.shuffle(shuffled)
    interval = iqm_interval(scores)
    assert scores.min() <= interval.low <= interval.high <= scores.max()
    assert iqm_interval(shuffled.reshape(scores.shape)).value == pytest.approx(interval.value)
    assert iqm_interval(unit * scores) == pytest.approx(tuple(unit * end for end in interval))
    assert iqm_interval(scores + unit) == pytest.approx(tuple(end + unit for end in interval))


def test_the_interval_of_one_scenario_is_scipy_s():
    sample = OURS.ravel()
    interval = stats.bootstrap(
        (sample,),
        lambda drawn, axis: stats.trim_mean(drawn, 0.25, axis=axis),
        method="percentile",
        n_resamples=9999,
        rng=np.random.default_rng(1),
    ).confidence_interval
    assert_alike(iqm_interval(sample[None])[1:], (interval.low, interval.high))


def test_seeds_are_drawn_within_scenarios():
    """A slow reference, scenario by scenario; drawing over all of them would give a wider interval."""
    scores = OURS + np.array([[0.0], [300.0], [5000.0]])
    rng = np.random.default_rng(2)

    def drawn():
        return np.concatenate([rng.choice(row, len(row)) for row in scores])

    means = [stats.trim_mean(drawn(), 0.25) for _ in range(4000)]
    assert_alike(iqm_interval(scores)[1:], tuple(np.quantile(means, [0.025, 0.975])))
    mixed = iqm_interval(scores.ravel()[None])
    assert mixed.high - mixed.low > 2 * (iqm_interval(scores).high - iqm_interval(scores).low)


def test_two_scenarios_of_constant_scores_have_no_spread():
    scores = np.array([[2.0] * 6, [4.0] * 6])
    assert iqm_interval(scores) == (3.0, 3.0, 3.0)


# --- probability of improvement


def test_the_probability_worked_out_by_hand():
    """Scenario 0: of 9 pairs (1 2 3 against 2 2 4) 6 are faster and 2 equal; scenario 1: none is."""
    ours, theirs = np.array([[1.0, 2.0, 3.0], [5.0, 5.0, 5.0]]), np.array([[2.0, 2.0, 4.0], [1.0, 1.0, 1.0]])
    faster, equal = 3 + 1 + 1, 2
    assert improvement_interval(ours, theirs).value == pytest.approx((faster + equal / 2) / 9 / 2)


@drawn()
@given(SCORES, st.randoms(use_true_random=False))
def test_the_probability_is_mann_whitney_s(scores, random):
    theirs = scores.ravel().copy()
    random.shuffle(theirs)
    theirs = theirs.reshape(scores.shape)
    us = [
        stats.mannwhitneyu(y, x, method="asymptotic").statistic for x, y in zip(scores, theirs, strict=True)
    ]
    ours = improvement_interval(scores, theirs)
    assert ours.value == pytest.approx(np.mean(us) / scores.shape[1] ** 2)
    back = improvement_interval(theirs, scores)
    assert back == pytest.approx((1 - ours.value, 1 - ours.high, 1 - ours.low))
    assert improvement_interval(scores**3, theirs**3) == ours  # only the order counts
    assert improvement_interval(scores, scores).value == 0.5
    assert improvement_interval(scores, scores + 100.0) == (1.0, 1.0, 1.0)


def test_the_interval_of_the_probability_draws_pairs():
    """A slow reference: the same seeds for both, scenario by scenario."""
    rng, (scenarios, seeds) = np.random.default_rng(5), OURS.shape
    found = []
    for _ in range(2000):
        shares = []
        for s in range(scenarios):
            rows = rng.integers(seeds, size=seeds)
            pairs = itertools.product(OURS[s, rows], THEIRS[s, rows])
            shares.append(np.mean([(x < y) + 0.5 * (x == y) for x, y in pairs]))
        found.append(np.mean(shares))
    assert_alike(improvement_interval(OURS, THEIRS)[1:], tuple(np.quantile(found, [0.025, 0.975])))


# --- profiles


def test_the_profile_worked_out_by_hand():
    scores = np.array([[0.5, 1.0, np.inf, 2.0]])
    shares = performance_profile(scores, np.array([0.4, 0.5, 1.0, 1.5, 2.0, 100.0]))
    assert shares.share.tolist() == [0.0, 0.25, 0.5, 0.5, 0.75, 0.75]
    assert (shares.low[0], shares.high[0]) == (0.0, 0.0)
    # the share of four draws with chance ½ each: 0 and 1 have chance 1/16 > 2.5 %
    assert (shares.low[2], shares.high[2]) == (0.0, 1.0)


@drawn()
@given(SCORES)
def test_a_profile_rises_within_its_band(scores):
    thresholds = np.linspace(0.0, 41.0, 30)
    found = performance_profile(scores, thresholds)
    np.testing.assert_allclose(found.share, [(scores <= level).mean() for level in thresholds])
    for curve in found:
        assert (np.diff(curve) >= 0).all() and curve[0] == 0.0 and curve[-1] == 1.0
    assert (found.low <= found.share + 1e-12).all() and (found.share <= found.high + 1e-12).all()


def test_the_band_of_a_share_is_that_of_coins():
    scores = np.tile([1.0, 3.0], (2, 40))  # 160 coins in two scenarios
    found = performance_profile(scores, np.array([2.0]))
    assert (found.low[0], found.high[0]) == pytest.approx(
        (0.5 - 1.96 / 2 / 160**0.5, 0.5 + 1.96 / 2 / 160**0.5), abs=0.008
    )


def test_draws_are_the_same_every_time():
    first = iqm_interval(OURS), improvement_interval(OURS, THEIRS)
    statistics._draws.cache_clear()
    statistics._counts.cache_clear()
    assert (iqm_interval(OURS), improvement_interval(OURS, THEIRS)) == first


# --- intervals


SAMPLE = np.random.default_rng(7).gamma(2.0, 300.0, 40)


def bootstrapped(statistic, *samples: np.ndarray) -> tuple[float, float]:
    """SciPy's percentile bootstrap."""
    interval = stats.bootstrap(
        samples,
        statistic,
        paired=len(samples) > 1,
        method="percentile",
        n_resamples=9999,
        rng=np.random.default_rng(11),
        vectorized=True,
    ).confidence_interval
    return float(interval.low), float(interval.high)


def test_the_interval_of_a_mean_is_scipy_s():
    mean, *interval = mean_interval(SAMPLE.tolist())
    assert mean == pytest.approx(SAMPLE.mean())
    assert_alike((interval[0], interval[1]), bootstrapped(np.mean, SAMPLE))
    spread = 1.96 * SAMPLE.std() / math.sqrt(40)
    assert_alike((interval[0], interval[1]), (mean - spread, mean + spread), 0.1)


def test_the_interval_of_a_median_is_scipy_s():
    median, *interval = median_interval(SAMPLE)
    assert median == pytest.approx(np.median(SAMPLE))
    assert_alike((interval[0], interval[1]), bootstrapped(np.median, SAMPLE), 0.1)


def test_the_interval_of_a_ratio_is_scipy_s_paired():
    lower = SAMPLE * np.random.default_rng(8).uniform(0.8, 1.2, 40)
    ratio, *interval = ratio_interval(SAMPLE, lower)
    assert ratio == pytest.approx(SAMPLE.mean() / lower.mean())

    def ratio_of_means(a, b, axis):
        return a.mean(axis=axis) / b.mean(axis=axis)

    assert_alike((interval[0], interval[1]), bootstrapped(ratio_of_means, SAMPLE, lower))
    shuffled = ratio_interval(SAMPLE, np.random.default_rng(1).permutation(lower))
    assert shuffled[2] - shuffled[1] > 2 * (interval[1] - interval[0])


def test_pairs_that_differ_by_a_factor_have_no_spread():
    assert ratio_interval(2.0 * SAMPLE, SAMPLE) == pytest.approx((2.0, 2.0, 2.0))
    with pytest.raises(ValueError, match="shape"):
        ratio_interval(SAMPLE, SAMPLE[:-1])


def test_intervals_worked_out_by_hand():
    """Two values 0 and 1: the resampled mean is 0, ½ or 1 with ¼, ½ and ¼; so is the median."""
    assert mean_interval([0.0, 1.0]) == (0.5, 0.0, 1.0)
    assert median_interval([0.0, 1.0]) == (0.5, 0.0, 1.0)
    assert mean_interval([3]) == median_interval([3]) == (3.0, 3.0, 3.0)
    assert ratio_interval([3.0], [2.0]) == (1.5, 1.5, 1.5)
    # 60 coins: the share of heads has σ = 0.5/√60; 1.96 of it is 0.1265
    assert mean_interval([0.0, 1.0] * 30) == pytest.approx((0.5, 0.3735, 0.6265), abs=0.011)


def test_the_means_of_a_few_starts_spread_with_their_number():
    """σ/√n around the mean."""
    for starts in (4, 16, 64):
        low, high = small_mean_range(np.arange(1000.0), starts)
        spread = 1.96 * np.arange(1000.0).std() / math.sqrt(starts)
        assert_alike((low, high), (499.5 - spread, 499.5 + spread), 0.05)


def test_intervals_are_the_same_every_time():
    assert mean_interval(SAMPLE) == mean_interval(SAMPLE)
    assert small_mean_range(SAMPLE, 5) == small_mean_range(SAMPLE, 5)


def test_ratios_of_medians_and_of_ratios_by_hand():
    """Samples of one kind have no spread; what differs by a factor has the factor."""
    assert median_ratio_interval(3.0 * SAMPLE, SAMPLE) == pytest.approx((3.0, 3.0, 3.0))
    assert median_ratio_interval([1.0, 2.0, 100.0], [4.0, 4.0, 4.0]).value == 0.5
    found = double_ratio_interval(6.0 * SAMPLE, SAMPLE, 3.0 * SAMPLE, SAMPLE)
    assert found == pytest.approx((2.0, 2.0, 2.0))


def test_a_curve_is_read_between_its_points_and_at_its_ends():
    ones = np.ones(5)
    times, costs = np.outer([30.0, 10.0], ones), np.outer([4.0, 8.0], ones)
    at = [interpolated_ratio_interval(times, costs, 10.0 * ones, cost * ones) for cost in (6.0, 1.0, 9.0)]
    assert at[0] == pytest.approx((2.0, 2.0, 2.0))  # halfway: 20 over 10
    assert [found.value for found in at[1:]] == [3.0, 1.0]
    turned = interpolated_ratio_interval(times[::-1], costs[::-1], 10.0 * ones, 6.0 * ones)
    assert turned == at[0]


# --- tests


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.5, 0.9]) == pytest.approx([1.0, 1.0])
    assert paired_p(np.ones(5), np.ones(5)) == 1.0
    five = np.arange(1.0, 6.0)
    assert paired_p(np.zeros(5), five) == pytest.approx(1 / 32)  # all five signs alike
    assert paired_p(five, np.zeros(5)) == 1.0
