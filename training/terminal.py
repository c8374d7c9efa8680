"""What a person sees of training: a bar while it runs, and a line for each validation."""

from __future__ import annotations

import sys
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from training.validation import Validation


class TrainingBar:
    """On standard error; the bar only where that is a terminal."""

    def __init__(self, total_steps: int, hidden: bool) -> None:
        """Make a bar; it is there while this is used as a context."""
        self._console = Console(file=sys.stderr, highlight=False, quiet=hidden)
        self._progress = Progress(
            TextColumn("learning"),
            BarColumn(),
            TextColumn("{task.completed:>12,.0f} of {task.total:,.0f} steps  {task.fields[told]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=hidden or not self._console.is_terminal,
        )
        self._task = self._progress.add_task("", total=total_steps, told="")

    def __enter__(self) -> TrainingBar:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def moved(self, steps: int) -> None:
        """So many steps are done."""
        self._progress.update(self._task, completed=steps)

    def validated(self, steps: int, found: Validation) -> None:
        """Validation found this."""
        self._progress.update(self._task, told=f"missions take {found.median_s:,.0f} s")
        self._console.print(
            f"{steps:>12,} steps: missions take {found.median_s:,.1f} s, {found.finished:.0%} finished",
            soft_wrap=True,
        )
