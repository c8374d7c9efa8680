"""What the terminal shows of training: a progress bar, and a line for each validation."""

from __future__ import annotations

import sys
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from training.validation import Validation


class TrainingBar:
    """Progress on standard error; the bar only where that is a terminal."""

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
        self._task = self._progress.add_task("", total=total_steps, latest="")

    def __enter__(self) -> TrainingBar:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def show_steps(self, steps: int) -> None:
        """Move the bar to this many steps."""
        self._progress.update(self._task, completed=steps)

    def show_validation(self, steps: int, validation: Validation) -> None:
        """Print what the validation after so many steps found."""
        self._progress.update(self._task, latest=f"missions take {validation.median_s:,.0f} s")
        self._console.print(
            f"{steps:>12,} steps: missions take {validation.median_s:,.1f} s (median), "
            f"{validation.finished:.0%} finished",
            soft_wrap=True,
        )
