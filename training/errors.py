"""The named errors of training; like those of the library, one line each."""

from __future__ import annotations

from entropy_explore_env.errors import EntropyExploreError, SettingError


class CheckpointError(SettingError):
    """A checkpoint cannot be used: missing, broken, foreign, or of a policy for something else."""


class NotFiniteError(EntropyExploreError):
    """Training met a number that is not finite."""

    def __init__(self, tensor: str, value: object, steps: int) -> None:
        """Name the tensor, show the number and the steps at which it came up."""
        super().__init__(f"{tensor} = {value} after {steps:,} steps: allowed are finite numbers")
        self.tensor, self.value, self.steps = tensor, value, steps
