"""Validations of a run with RLlib: its curve, and its best policy in the form that strategies load."""
# pyright: reportMissingImports=false

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from baselines.experiments.tables import csv_table
from entropy_explore_env.writing import write_atomically
from training.checkpoints import PolicySettings, checkpoint_name, forget_later, save_checkpoint
from training.policy import load_policy
from training.rllib_module import policy_in
from training.validation import Validation, Validator

CURVE = "curve.csv"


class RunValidation:
    """The validations of one run, which is continued where its folder says.

    Attributes:
        curve: A row for each validation: decisions, robot_steps, seconds, and what it found.
        next_at: Decisions after which the next one is due.
    """

    def __init__(self, out: Path, settings: PolicySettings, validator: Validator, every: int) -> None:
        """Read what the folder says.

        Args:
            out: The run's folder.
            settings: Of the policy.
            validator: Runs the missions.
            every: Decisions between two validations.
        """
        self._out, self._settings, self._every = out, settings, every
        self._validator = validator
        self.curve, self.next_at = read_rows(out / CURVE), every

    def resume(self, decisions: int) -> None:
        """Forget what came after the checkpoint that the run goes on from."""
        self.curve = [row for row in self.curve if row["decisions"] <= decisions]
        self.next_at = (decisions // self._every + 1) * self._every
        forget_later(self._out, "best", decisions)

    def validate(self, reached: dict[str, float], weights: dict[str, np.ndarray]) -> Validation:
        """Run the missions, add a row to the curve, and keep the policy if it is the best so far.

        Args:
            reached: How far the run is: decisions, robot_steps, seconds.
            weights: State of the module that is learned.
        """
        checkpoint = policy_in(weights, self._settings, {**reached, "steps": int(reached["decisions"])})
        found = self._validator.validate(load_policy(checkpoint))
        assert found is not None
        best = min((row["mean_s"] for row in self.curve), default=np.inf)
        self.curve.append({**reached, **_numbers(found)})
        self.next_at += self._every
        columns = {name: [row[name] for row in self.curve] for name in self.curve[0]}
        write_atomically(self._out / CURVE, csv_table(columns))
        if found.mean_s < best:
            checkpoint.progress["validation"] = self.curve[-1]
            save_checkpoint(self._out / checkpoint_name("best", int(reached["decisions"])), checkpoint)
        return found

    def close(self) -> None:
        """End the missions."""
        self._validator.close()


def _numbers(found: Validation) -> dict[str, Any]:
    return dataclasses.asdict(found)


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a table of numbers, none where there is no file; empty cells are None."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [
            {name: float(cell) if cell else None for name, cell in row.items()}
            for row in csv.DictReader(file)
        ]
