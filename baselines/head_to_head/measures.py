"""Measures across scenarios, with intervals: interquartile mean, probability of improvement, profile.

Definitions of Agarwal, Schwarzer, Castro, Courville and Bellemare, *Deep Reinforcement Learning at the Edge
of the Statistical Precipice* (NeurIPS 2021). Its package rliable 1.2 cannot be imported beside pandas 3, and
draws the missions of two strategies apart, although ours share their seeds.

Scores are times: smaller is better. Letters: S scenarios, N seeds, T thresholds, B resamples. Intervals hold
95 %: percentiles of a bootstrap that draws seeds with replacement within every scenario (stratified), the
same draws for all strategies (paired).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

_RESAMPLES = 4999
_CONFIDENCE = 0.95


class Estimate(NamedTuple):
    """A figure with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


def interquartile_mean(scores: np.ndarray) -> np.ndarray:
    """Mean without the lowest and the highest quarter; what is less than a whole score of them stays.

    Args:
        scores: (…, n) float64.

    Returns:
        (…,) float64.
    """
    cut = scores.shape[-1] // 4
    return np.sort(scores, axis=-1)[..., cut : scores.shape[-1] - cut].mean(axis=-1)


def iqm_interval(scores: np.ndarray) -> Estimate:
    """Interquartile mean over all scenarios and seeds.

    Args:
        scores: (S, N) float64.
    """
    drawn = np.take_along_axis(scores[None], _draws(*scores.shape), axis=2)  # (B, S, N)
    return _estimate(interquartile_mean(scores.ravel()), interquartile_mean(drawn.reshape(len(drawn), -1)))


def improvement_interval(ours: np.ndarray, theirs: np.ndarray) -> Estimate:
    """Probability that a mission of ours is faster than one of theirs in the same scenario.

    P = 1/S Σ_s 1/N² Σ_ij [ours_si < theirs_sj], ties count ½ (Mann-Whitney's U over N²).

    Args:
        ours: (S, N) float64.
        theirs: (S, N) float64, the same scenarios and seeds.
    """
    better = ours[:, :, None] < theirs[:, None, :]
    wins = better + 0.5 * (ours[:, :, None] == theirs[:, None, :])  # (S, N, N)
    counts = _counts(*ours.shape)
    drawn = ((counts.transpose(1, 0, 2) @ wins) * counts.transpose(1, 0, 2)).sum(axis=2)  # (S, B)
    return _estimate(wins.mean(), drawn.mean(axis=0) / ours.shape[1] ** 2)


class Profile(NamedTuple):
    """Share of missions within each threshold, (T,) float64, with the ends of its pointwise 95 % interval."""

    share: np.ndarray
    low: np.ndarray
    high: np.ndarray


def profile(scores: np.ndarray, thresholds: np.ndarray) -> Profile:
    """Performance profile: the share of missions whose score is at most a threshold.

    Args:
        scores: (S, N) float64; inf = never.
        thresholds: (T,) float64.
    """
    within = (scores[:, :, None] <= thresholds).reshape(scores.size, -1).astype(float)
    drawn = _counts(*scores.shape).reshape(-1, scores.size) @ within / scores.size  # (B, T)
    return Profile(within.mean(axis=0), *np.quantile(drawn, _ends(), axis=0))


def _estimate(value: float | np.ndarray, drawn: np.ndarray) -> Estimate:
    low, high = np.quantile(drawn, _ends())
    return Estimate(float(value), float(low), float(high))


def _ends() -> tuple[float, float]:
    return (1 - _CONFIDENCE) / 2, (1 + _CONFIDENCE) / 2


@lru_cache(maxsize=2)
def _draws(scenarios: int, seeds: int) -> np.ndarray:
    """(B, S, N) which seeds are drawn, always the same ones."""
    return np.random.default_rng(0).integers(seeds, size=(_RESAMPLES, scenarios, seeds))


@lru_cache(maxsize=2)
def _counts(scenarios: int, seeds: int) -> np.ndarray:
    """(B, S, N) float64 how often each seed is drawn; sums over whole and half numbers are exact."""
    draws = _draws(scenarios, seeds)
    counts = np.zeros(draws.shape)
    drawn, scenario = np.ogrid[: len(draws), :scenarios]
    np.add.at(counts, (drawn[..., None], scenario[..., None], draws), 1.0)
    return counts
