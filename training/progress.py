"""How far a training run is: its seconds, validations and best policy, and what TensorBoard shows of it."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
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
        """Note a validation after so many steps; whether its mission time is the shortest so far."""
        row = {"steps": steps, **dataclasses.asdict(validation)}
        self.curve.append({"steps": steps, **self.seconds, **dataclasses.asdict(validation)})
        if self.best and validation.mean_s >= self.best["mean_s"]:
            return False
        self.best = row
        return True

    def validated(self, steps: int) -> bool:
        """Whether the latest validation was after so many steps."""
        return bool(self.curve) and self.curve[-1]["steps"] == steps

    def curve_csv(self) -> str:
        """The curve as a table."""
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
