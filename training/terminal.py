"""What the terminal shows of training: a progress bar, and a line for each validation."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from training.validation import Validation

LINE_EVERY_S = 20.0
"""Where there is no terminal, a line says this often how far the run is."""


class TrainingBar:
    """Progress on standard error: a bar where that is a terminal, else lines at times."""

    def __init__(self, total_steps: int, hidden: bool) -> None:
        """Make a bar, which is shown while this is used as a context."""
        self._console = Console(file=sys.stderr, highlight=False, quiet=hidden)
        self._progress = Progress(
            TextColumn("training"),
            BarColumn(),
            TextColumn("{task.completed:,.0f} of {task.total:,.0f} steps  {task.fields[latest]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=hidden or not self._console.is_terminal,
        )
        self._lines = not hidden and not self._console.is_terminal
        self._total, self._began_s, self._next_s = total_steps, 0.0, 0.0
        self._first_steps: int | None = None
        self._task = self._progress.add_task("", total=total_steps, latest="")

    def __enter__(self) -> TrainingBar:
        self._progress.start()
        self._began_s = self._next_s = time.perf_counter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def say(self, line: str) -> None:
        """Print a line, above the bar."""
        self._console.print(line, soft_wrap=True)

    def show_steps(self, steps: int) -> None:
        """Move the bar to this many steps, or say so in a line, if one is due."""
        self._progress.update(self._task, completed=steps)
        now_s = time.perf_counter()
        if self._first_steps is None:
            self._first_steps = steps
        elif self._lines and now_s >= self._next_s and steps > self._first_steps:
            self._next_s = now_s + LINE_EVERY_S
            speed = (steps - self._first_steps) / max(now_s - self._began_s, 1e-9)
            left_min = max(self._total - steps, 0) / max(speed, 1e-9) / 60.0
            self.say(
                f"{steps:>12,} steps of {self._total:,}, {speed:,.0f} a second, {left_min:,.0f} min left, "
                "and validations"
            )

    def say_validating(self, steps: int, missions: int) -> None:
        """Say that a validation begins, where lines stand in place of the bar."""
        if self._lines:
            self.say(f"{steps:>12,} steps: validating in {missions:,} missions")

    def show_validation(self, steps: int, validation: Validation) -> None:
        """Print what the validation after so many steps found."""
        self._progress.update(self._task, latest=f"missions take {validation.median_s:,.0f} s")
        ratio = validation.planner_ratio
        beside = "" if ratio is None else f", {ratio:.3f} times as long as the planner's"
        self._console.print(
            f"{steps:>12,} steps: missions take {validation.median_s:,.1f} s (median){beside}, "
            f"{validation.finished:.0%} finished",
            soft_wrap=True,
        )
