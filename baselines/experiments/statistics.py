"""Statistics over missions: bootstrap intervals and paired tests.

Intervals hold 95 %: percentiles of a bootstrap over missions, which draws the same resamples in every
call. What is compared with the same seeds is resampled in pairs. `scipy.stats.bootstrap` agrees within its
own noise (the tests compare them); ours repeats bit for bit, also for ratios of two and of four samples.

Letters: S tasks, N missions of each, B resamples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

_CONFIDENCE = 0.95
_RESAMPLES = 9999

Sample = Sequence[float] | np.ndarray
"""(N,) one figure of each mission, by seed where it is compared."""


class Range(NamedTuple):
    """Where 95 % of something lie."""

    low: float
    high: float


class Interval(NamedTuple):
    """A figure with the ends of its 95 % interval."""

    value: float
    low: float
    high: float

    def __format__(self, form: str) -> str:
        """Return the figure and its ends in a format of numbers, as `0.98 (0.95 … 1.02)`."""
        value, low, high = (format(number, form or ".4g") for number in self)
        return f"{value} ({low} … {high})"


def mean_interval(values: Sample) -> Interval:
    """Return the mean and its interval."""
    sample = np.asarray(values, float)
    return Interval(float(sample.mean()), *_central(_resampled(sample, len(sample)).mean(axis=1)))


def median_interval(values: Sample) -> Interval:
    """Return the median and its interval."""
    sample = np.asarray(values, float)
    medians = np.median(_resampled(sample, len(sample)), axis=1)
    return Interval(float(np.median(sample)), *_central(medians))


def small_mean_range(values: Sample, missions: int) -> Range:
    """Return where 95 % of the means of only this many missions lie."""
    return _central(_resampled(np.asarray(values, float), missions).mean(axis=1))


def central_range(values: Sample) -> Range:
    """Return where the central 95 % of the values themselves lie."""
    return _central(np.asarray(values, float))


def ratio_interval(numerator: Sample, denominator: Sample) -> Interval:
    """Return the ratio of two means over the same seeds, and its interval (paired bootstrap)."""
    return _ratio_of(np.mean, numerator, denominator)


def median_ratio_interval(numerator: Sample, denominator: Sample) -> Interval:
    """Return the ratio of two medians over the same seeds, and its interval (paired bootstrap)."""
    return _ratio_of(np.median, numerator, denominator)


def _ratio_of(statistic: Callable[..., Any], numerator: Sample, denominator: Sample) -> Interval:
    pairs = np.stack([np.asarray(numerator, float), np.asarray(denominator, float)], axis=1)
    drawn = statistic(_resampled(pairs, len(pairs)), axis=1)
    ratio = float(statistic(pairs[:, 0]) / statistic(pairs[:, 1]))
    return Interval(ratio, *_central(drawn[:, 0] / drawn[:, 1]))


def geometric_ratio_interval(ours: Sequence[Sample], theirs: Sequence[Sample]) -> Interval:
    """Return the geometric mean over tasks of the geometric mean of paired ratios in each, and its interval.

    exp( 1/S Σ_s 1/N_s Σ_i ln(ours_si / theirs_si) ); the bootstrap draws pairs within each task.

    Args:
        ours: Of each of S tasks (N_s,) figures > 0.
        theirs: The same missions.
    """
    logs = [np.log(np.asarray(a, float) / np.asarray(b, float)) for a, b in zip(ours, theirs, strict=True)]
    drawn = np.mean([_resampled(log, len(log), place).mean(axis=1) for place, log in enumerate(logs)], axis=0)
    return Interval(float(np.exp(np.mean([log.mean() for log in logs]))), *_central(np.exp(drawn)))


def interpolated_ratio_interval(
    times: np.ndarray, costs: np.ndarray, time: np.ndarray, cost: np.ndarray
) -> Interval:
    """Return a curve of mean times over mean costs, read at a cost, over the time paid there; its interval.

    Beyond the curve's ends its nearest point is read.

    Args:
        times: (K, N) of K points of the curve, by seed.
        costs: (K, N) theirs.
        time: (N,) of what is compared with the curve, by the same seeds.
        cost: (N,) its own.
    """
    all_times, all_costs = np.concatenate([times, time[None]]), np.concatenate([costs, cost[None]])
    rows = _resampled(np.arange(len(time)), len(time))  # (B, N)

    def ratio(mean_times: np.ndarray, mean_costs: np.ndarray) -> float:
        order = np.argsort(mean_costs[:-1])
        read = np.interp(mean_costs[-1], mean_costs[:-1][order], mean_times[:-1][order])
        return float(read / mean_times[-1])

    drawn_times, drawn_costs = all_times[:, rows].mean(axis=2), all_costs[:, rows].mean(axis=2)
    drawn = [ratio(drawn_times[:, row], drawn_costs[:, row]) for row in range(len(rows))]
    return Interval(ratio(all_times.mean(axis=1), all_costs.mean(axis=1)), *_central(np.asarray(drawn)))


def paired_p(smaller: np.ndarray, larger: np.ndarray) -> float:
    """Return the one-sided p of Wilcoxon's signed-rank test that the first are smaller; 1 = all are equal."""
    if np.array_equal(smaller, larger):
        return 1.0
    result: Any = stats.wilcoxon(smaller, larger, alternative="less")  # SciPy gives it no type
    return float(result.pvalue)


def holm(p_values: Sequence[float]) -> np.ndarray:
    """Return the p-values corrected for their number (Holm 1979)."""
    p = np.asarray(p_values, float)
    order = np.argsort(p, kind="stable")
    scaled = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(scaled, 1.0)
    return corrected


_ENDS = ((1 - _CONFIDENCE) / 2, (1 + _CONFIDENCE) / 2)
"""Quantiles that enclose the central 95 %."""


def _central(values: np.ndarray) -> Range:
    low, high = np.quantile(values, _ENDS)
    return Range(float(low), float(high))


def _resampled(sample: np.ndarray, size: int, stream: int = 0) -> np.ndarray:
    """Return (B, size, …) draws with replacement, always the same ones of a stream."""
    rows = np.random.default_rng(stream).integers(len(sample), size=(_RESAMPLES, size))
    return sample[rows]
