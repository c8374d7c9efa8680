"""The named errors of training; like those of the library, one line each."""

from __future__ import annotations

from entropy_explore_env.errors import EntropyExploreError, SettingError


class CheckpointError(SettingError):
    """A checkpoint cannot be used: missing, broken, foreign, or of a policy for something else."""


class LabelsError(SettingError):
    """Labels of roll-outs cannot be used: broken, of other settings, or of another version of the code."""


class RollOutError(EntropyExploreError):
    """A roll-out makes no headway: its mission takes steps and comes to no decision or end."""

    def __init__(self, scenario: str, seed: int, episode: int, steps: int, time_s: float) -> None:
        """Say which mission, from its seed, and how long it went on."""
        super().__init__(
            f"roll-out of seed {seed}, episode {episode} of {scenario} at {time_s:.1f} s: {steps:,} steps "
            f"without an end: allowed are roll-outs that come to their horizon or their end"
        )


class DivergedError(EntropyExploreError):
    """A regression ends farther from its labels than it began, or with numbers that are not finite."""

    def __init__(self, loss: float, at_first: float, epoch: int) -> None:
        """Show the loss, the one before learning, and the epoch."""
        super().__init__(
            f"regression loss = {loss:.4g} after epoch {epoch}: allowed is less than ten times that before "
            f"learning ({at_first:.4g}); a smaller --learning-rate may help"
        )


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
