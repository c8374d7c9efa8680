"""Running mean and standard deviation, so that networks see numbers around 1 whatever the scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from stable_baselines3.common.running_mean_std import RunningMeanStd

from training.errors import CheckpointError

_MIN_STD = 1e-4
"""A component whose standard deviation is smaller is shifted and not scaled: it never changed so far."""


class Normaliser(RunningMeanStd):
    """Stable-Baselines3's running mean and variance, which may forget, and what they normalise.

    Attributes:
        count: Samples so far, at most `memory`.
        mean: (F,) float64.
        var: (F,) float64.
    """

    def __init__(self, size: int = 1, memory: float = math.inf) -> None:
        """Begin with mean 0 and variance 1, which the first samples replace.

        Args:
            size: F, components of a sample.
            memory: The samples so far weigh at most as much as this many.
        """
        super().__init__(epsilon=0.0, shape=(size,))
        self.memory = memory

    def update(self, arr: np.ndarray) -> None:
        """Add samples (n,) or (n, F)."""
        samples = np.asarray(arr, np.float64).reshape(-1, len(self.mean))
        if len(samples):
            super().update(samples)
            self.count = min(self.count, self.memory)

    @property
    def std(self) -> np.ndarray:
        """(F,) standard deviations; 1 where a component does not change."""
        std = np.sqrt(self.var)
        return np.where(std > _MIN_STD, std, 1.0)

    def normalise(self, values: np.ndarray) -> np.ndarray:
        """(values - mean) / std; with one component, of values of any shape."""
        return (values - self.mean) / self.std

    def denormalise(self, values: np.ndarray) -> np.ndarray:
        """The inverse of `normalise`."""
        return values * self.std + self.mean

    def arrays(self, name: str) -> dict[str, np.ndarray]:
        """What a checkpoint keeps: arrays whose names begin with `name`."""
        return {
            f"{name}_count": np.array(self.count),
            f"{name}_mean": self.mean,
            f"{name}_variance": self.var,
        }

    def load_arrays(self, name: str, arrays: Mapping[str, np.ndarray]) -> None:
        """Take over what `arrays` gave.

        Raises:
            CheckpointError: An array is missing, of another size or not finite. Nothing has changed then.
        """
        wanted = {f"{name}_count": (), f"{name}_mean": self.mean.shape, f"{name}_variance": self.var.shape}
        for part, shape in wanted.items():
            array = arrays.get(part)
            fits = array is not None and array.shape == shape and array.dtype == np.float64
            if array is None or not fits or not np.isfinite(array).all():
                given = None if array is None else array.shape
                raise CheckpointError(f"normalisation: {part}", given, f"{shape} finite float64")
        count, mean, variance = (arrays[part] for part in wanted)
        self.count, self.mean, self.var = float(count), mean, variance
