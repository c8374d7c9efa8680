"""Statistics against values worked out by hand, slow references, SciPy, and what must not change them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from baselines.experiments.statistics import (
    geometric_ratio_interval,
    holm,
    interpolated_ratio_interval,
    mean_interval,
    median_interval,
    median_ratio_interval,
    paired_p,
    ratio_interval,
    small_mean_range,
)


def assert_alike(ours, theirs, share=0.06):
    """Ends of intervals agree up to a small share of the width: both draw at random."""
    assert ours == pytest.approx(theirs, abs=share * (theirs[1] - theirs[0]))


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


@pytest.mark.parametrize(
    ("interval_of", "statistic", "share"), [(mean_interval, np.mean, 0.06), (median_interval, np.median, 0.1)]
)
def test_the_interval_of_a_mean_and_of_a_median_is_scipy_s(interval_of, statistic, share):
    value, low, high = interval_of(SAMPLE.tolist())
    assert value == pytest.approx(statistic(SAMPLE))
    assert_alike((low, high), bootstrapped(statistic, SAMPLE), share)


def test_the_interval_of_a_ratio_is_scipy_s_paired():
    lower = SAMPLE * np.random.default_rng(8).uniform(0.8, 1.2, 40)
    ratio, *interval = ratio_interval(SAMPLE, lower)
    assert ratio == pytest.approx(SAMPLE.mean() / lower.mean())

    def ratio_of_means(a, b, axis):
        return a.mean(axis=axis) / b.mean(axis=axis)

    assert_alike((interval[0], interval[1]), bootstrapped(ratio_of_means, SAMPLE, lower))
    shuffled = ratio_interval(SAMPLE, np.random.default_rng(1).permutation(lower))
    assert shuffled[2] - shuffled[1] > 2 * (interval[1] - interval[0])


def test_the_ratio_over_tasks_is_the_geometric_mean_of_theirs():
    lower = SAMPLE * np.random.default_rng(8).uniform(0.8, 1.2, 40)
    ratio, *interval = geometric_ratio_interval([SAMPLE], [lower])
    logs = np.log(SAMPLE / lower)
    assert ratio == pytest.approx(stats.gmean(SAMPLE / lower))
    assert_alike((interval[0], interval[1]), tuple(np.exp(bootstrapped(np.mean, logs))))
    # a task of four missions counts as much as one of forty: √(2 · 8), and neither has any spread
    tasks = [2.0 * SAMPLE, 8.0 * SAMPLE[:4]], [SAMPLE, SAMPLE[:4]]
    assert geometric_ratio_interval(*tasks) == pytest.approx((4.0, 4.0, 4.0))
    two = geometric_ratio_interval([SAMPLE, SAMPLE], [lower, lower])
    assert two.value == pytest.approx(ratio)
    width = math.log(interval[1] / interval[0])
    assert math.log(two.high / two.low) == pytest.approx(width / math.sqrt(2), rel=0.1)  # drawn apart


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


def test_ratios_of_medians_by_hand():
    assert median_ratio_interval(3.0 * SAMPLE, SAMPLE) == pytest.approx((3.0, 3.0, 3.0))
    assert median_ratio_interval([1.0, 2.0, 100.0], [4.0, 4.0, 4.0]).value == 0.5


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
