"""The named errors of training; like those of the library, one line each."""

from __future__ import annotations

from entropy_explore_env.errors import EntropyExploreError, SettingError


class CheckpointError(SettingError):
    """A checkpoint cannot be used: missing, broken, foreign, or made for something else."""


class NotFiniteError(EntropyExploreError):
    """Training met a number that is not finite."""

    def __init__(self, tensor: str, value: object, steps: int | None = None) -> None:
        """Name the tensor, show the number, say when."""
        when = "" if steps is None else f" after {steps:,} steps"
        super().__init__(f"{tensor} = {value}{when}: allowed are finite numbers")
        self.tensor, self.value, self.steps = tensor, value, steps
