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


class SilentRunnersError(EntropyExploreError):
    """No runner has reported for so long that a run cannot go on."""

    def __init__(self, runners: int, seconds: float, decisions: int) -> None:
        """Say how many there are, how long they were waited for, and how far the run had come."""
        super().__init__(
            f"none of {runners} runners reported within {seconds:,.0f} s, after {decisions:,} decisions: "
            "--resume goes on from the last checkpoint"
        )
        self.runners, self.seconds, self.decisions = runners, seconds, decisions
