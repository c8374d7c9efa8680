"""The slope of mission times along weights, estimated from pairs of missions; see `training.search`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

_OLDER = 0.5
"""Weight of a round's pairs, relative to those of the round after it."""
_RIDGE = 1.0


class Pairs(NamedTuple):
    """Results of N pairs of missions in one task and round."""

    directions: np.ndarray
    """(N, S) e."""
    slopes: np.ndarray
    """(N,) y."""
    ln_times: np.ndarray
    """(N,) mean of both logarithms of seconds."""
    finished: float = 1.0
    """Share of the missions that were finished."""


def shrunk_slope(history: Sequence[Sequence[Pairs]]) -> tuple[np.ndarray, float]:
    """Return the slope g from the pairs of all rounds so far, of which the latest count most.

    Args:
        history: Of each round a Pairs for each task.

    Returns:
        (S,) g, shrunk towards zero as far as it is uncertain; and how long it should be without that, 0 where
        it is no longer than chance makes it on average.
    """
    tasks, size = len(history[-1]), history[-1][0].directions.shape[1]
    slope, covariance = np.zeros(size), np.zeros((size, size))
    for task in range(tasks):
        parts = [parts[task] for parts in history]
        directions = np.concatenate([part.directions for part in parts])
        slopes = np.concatenate([part.slopes for part in parts])
        ages = np.repeat(np.arange(len(parts))[::-1], [len(part.slopes) for part in parts])
        own, uncertain = _least_squares(directions, slopes, _OLDER**ages)
        slope, covariance = slope + own / tasks, covariance + uncertain / tasks**2
    variance = max(float(slope @ slope - np.trace(covariance)) / size, 0.0)
    if variance == 0.0:
        return np.zeros(size), 0.0
    shrunk = variance * np.linalg.solve(variance * np.eye(size) + covariance, slope)
    return shrunk, math.sqrt(size * variance)


def _least_squares(
    directions: np.ndarray, slopes: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the slope (S,) that fits best, and its covariance (S, S)."""
    size = directions.shape[1]
    weighted = directions.T * weights
    inverse = np.linalg.inv(weighted @ directions + _RIDGE * np.eye(size))
    leaves = np.eye(len(slopes)) - directions @ inverse @ weighted  # what is left over, from what there was
    left, freedom = leaves @ slopes, float((weights[:, None] * leaves**2).sum())
    noise = float(weights @ left**2) / max(freedom, 1e-9)
    return inverse @ (weighted @ slopes), noise * inverse @ (weighted * weights) @ directions @ inverse
