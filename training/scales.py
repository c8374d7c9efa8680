"""Running means and deviations, so that networks see numbers around 1 whatever the scenario."""

from __future__ import annotations

import math

import numpy as np

_LEAST = 1e-4
"""Smaller deviations do not scale: a number that never changes stays near 0."""


class RunningScale:
    """Mean and standard deviation of all that it has seen, per component (Chan, Golub & LeVeque 1983).

    Attributes:
        count: Samples seen.
        mean: (F,) float64.
        variance: (F,) float64.
    """

    def __init__(self, size: int = 1, memory: float = math.inf) -> None:
        """Nothing seen: mean 0, deviation 1; samples older than the latest `memory` fade away."""
        self.memory = memory
        self.count, self.mean, self.variance = 0.0, np.zeros(size), np.ones(size)

    def update(self, samples: np.ndarray) -> None:
        """See (n,) or (n, F) more samples."""
        batch = np.asarray(samples, np.float64).reshape(-1, len(self.mean))
        if not len(batch):
            return
        total, mean, variance = self.count + len(batch), batch.mean(axis=0), batch.var(axis=0)
        apart = mean - self.mean
        spread = self.variance * self.count + variance * len(batch)
        self.variance = (spread + apart**2 * self.count * len(batch) / total) / total
        self.mean = self.mean + apart * len(batch) / total
        self.count = min(total, self.memory)

    def follow(self, other: RunningScale) -> None:
        """Take over what another one has seen."""
        self.count, self.mean, self.variance = other.count, other.mean.copy(), other.variance.copy()

    @property
    def deviation(self) -> np.ndarray:
        """(F,) standard deviations, 1 where there is none to speak of."""
        deviation = np.sqrt(self.variance)
        return np.where(deviation > _LEAST, deviation, 1.0)

    def scaled(self, values: np.ndarray) -> np.ndarray:
        """(values - mean) / deviation; of one component for values of any shape."""
        return (values - self.mean) / self.deviation

    def restored(self, values: np.ndarray) -> np.ndarray:
        """The inverse of `scaled`."""
        return values * self.deviation + self.mean
