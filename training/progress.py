"""What a person sees and does of a run: progress, curve, TensorBoard, and the terminal."""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Literal

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from stable_baselines3.common.callbacks import BaseCallback

from baselines.experiments.tables import csv_table
from training.advantages import DecisionBuffer
from training.validation import Validation

_FIGURES = ("t_mission_s", "finished", "bits_gained_per_bit_sent", "overlap", "scans")
"""Figures of missions that TensorBoard shows."""
Part = Literal["collecting_s", "learning_s", "validating_s"]


@dataclass
class Progress:
    """What a run has come to.

    Attributes:
        next_validation, next_checkpoint: Steps at which they are due; the first checkpoint at once, so that a
            run that is stopped early can be continued.
        best: Steps and validation of the best policy; empty before the first validation.
        curve: One row for each validation: steps, seconds so far, and what it found.
        seconds: On the clock, for each part of the loop; and `processor_s`, of all threads together.
    """

    next_validation: int
    next_checkpoint: int = 1
    best: dict[str, Any] = field(default_factory=dict)
    curve: list[dict[str, float | None]] = field(default_factory=list)
    seconds: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(
            ("collecting_s", "learning_s", "validating_s", "processor_s"), 0.0
        )
    )

    @contextmanager
    def timed(self, part: Part) -> Iterator[None]:
        """Count the time that is spent inside."""
        began_s, processor_s = time.perf_counter(), time.process_time()
        yield
        self.seconds[part] += time.perf_counter() - began_s
        self.seconds["processor_s"] += time.process_time() - processor_s

    def add_validation(self, steps: int, validation: Validation) -> bool:
        """Note a validation after this many steps; whether its mission time is the shortest so far."""
        row = {"steps": steps, **dataclasses.asdict(validation)}
        self.curve.append({"steps": steps, **self.seconds, **dataclasses.asdict(validation)})
        if self.best and validation.mean_s >= self.best["mean_s"]:
            return False
        self.best = row
        return True

    def validated(self, steps: int) -> bool:
        """Return whether the latest validation was after this many steps."""
        return bool(self.curve) and self.curve[-1]["steps"] == steps

    def curve_csv(self) -> str:
        """Return the curve as a table."""
        return csv_table({name: [row[name] for row in self.curve] for name in self.curve[0]})


class MissionFigures(BaseCallback):
    """Logs what the missions of each rollout came to."""

    def __init__(self, robots: int) -> None:
        """Expect this many robots, rows of the environments, in each mission."""
        super().__init__()
        self._robots = robots
        self._figures: list[dict[str, float | None]] = []

    def _on_step(self) -> bool:
        ended = np.flatnonzero(self.locals["dones"])[:: self._robots]  # the rows of a mission end together
        self._figures += [self.locals["infos"][row]["figures"] for row in ended]
        return True

    def _on_rollout_end(self) -> None:
        buffer: Any = self.locals["rollout_buffer"]
        assert isinstance(buffer, DecisionBuffer)
        self.logger.record("missions/busy_share", 1.0 - float(buffer.steps.decided.mean()))
        for name in _FIGURES:
            values = [each[name] for each in self._figures if each[name] is not None]
            if values:
                self.logger.record(f"missions/{name}", float(np.mean(np.array(values, float))))
        self._figures.clear()


LINE_EVERY_S = 20.0
"""Where there is no terminal, a line says this often how far the run is."""


class TrainingBar:
    """Progress on standard error: a bar where that is a terminal, else lines at times."""

    def __init__(self, total_steps: int, hidden: bool) -> None:
        """Make a bar, which is shown while this is used as a context."""
        self._console = Console(file=sys.stderr, highlight=False, quiet=hidden)
        self._bar = Bar(
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
        self._task = self._bar.add_task("", total=total_steps, latest="")

    def __enter__(self) -> TrainingBar:
        self._bar.start()
        self._began_s = self._next_s = time.perf_counter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def say(self, line: str) -> None:
        """Print a line, above the bar."""
        self._console.print(line, soft_wrap=True)

    def show_steps(self, steps: int) -> None:
        """Move the bar to this many steps, or say so in a line, if one is due."""
        self._bar.update(self._task, completed=steps)
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
        """Print what the validation after this many steps found."""
        self._bar.update(self._task, latest=f"missions take {validation.median_s:,.0f} s")
        ratio = validation.planner_ratio
        beside = "" if ratio is None else f", {ratio:.3f} times as long as the planner's"
        self._console.print(
            f"{steps:>12,} steps: missions take {validation.median_s:,.1f} s (median){beside}, "
            f"{validation.finished:.0%} finished",
            soft_wrap=True,
        )
