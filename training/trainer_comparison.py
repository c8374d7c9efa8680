"""What trainers learn in the same number of robot-steps, from the folders of their runs.

    python -m training.trainer_comparison runs/* --out docs/results

Takes runs of `training.ppo` and `training.rllib_ppo` in one scenario, which validate alike: in the same
missions, after steps counted in the same way. Runs that differ in the seed alone are one trainer's. Writes
`trainers.md`, with a curve for each run. The trainers need environments of their own: this command runs none.
"""

from __future__ import annotations

import csv
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from baselines.cli.arguments import Positional, make_folder, parse, run_command
from baselines.experiments.tables import markdown_table
from entropy_explore_env.errors import SettingError, counted
from entropy_explore_env.writing import write_atomically
from training.run_folder import FILE

GOAL = 1.2
"""The median mission time of another trainer is to be at most this many times that of the first."""
_TASK = ("scenario", "robots", "task", "cost_per_s", "validation_missions")
"""Options in which runs must not differ."""
_STEPS = {"training.ppo": "steps", "training.rllib_ppo": "robot_steps"}
"""Trainer → the column of its curve that counts robot-steps."""


@dataclass(frozen=True)
class Args:
    """Compare trainers by the folders of their runs, and write a page.

    Attributes:
        runs: Folders, those of the trainer that others are compared with first.
        out: Folder for trainers.md; its figure and table go into trainers in it.
    """

    runs: Positional[tuple[Path, ...]] = ()
    out: Path = Path("results/trainers")


class Validated(NamedTuple):
    """A validation of a run."""

    robot_steps: float
    mean_s: float
    """Of mission time; so is the median."""
    median_s: float


class Run(NamedTuple):
    """A run of a trainer."""

    command: str
    trainer: str
    """What tells it from others but the seed."""
    task: dict[str, Any]
    """What it learns and validates in."""
    seed: int
    curve: list[Validated]

    def best_by(self, robot_steps: float) -> Validated:
        """The validation of the policy that is kept after so many steps: that with the least mean time."""
        return min(
            (each for each in self.curve if each.robot_steps <= robot_steps), key=lambda each: each.mean_s
        )


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    runs = [read_run(folder) for folder in args.runs]
    if not runs:
        raise SettingError("runs", (), "at least one folder of a run")
    check_comparable(runs)
    make_folder("out", args.out)
    from training.trainer_curves import curves_csv, curves_png  # matplotlib: after the help

    write_atomically(args.out / "trainers" / "curves.png", curves_png(runs))
    write_atomically(args.out / "trainers" / "curves.csv", curves_csv(runs))
    write_atomically(args.out / "trainers.md", page(runs))
    print(f"written: {args.out / 'trainers.md'}", file=sys.stderr)
    return 0


def check_comparable(runs: Sequence[Run]) -> None:
    """Raise a SettingError where runs differ in what they learn in, or were not validated early enough."""
    first, steps = runs[0], min(run.curve[-1].robot_steps for run in runs)
    for run in runs:
        for name, value in run.task.items():
            if not _alike(value, first.task[name]):
                allowed = f"that of the first: {first.task[name]}"
                raise SettingError(f"runs: {name} of {run.command}", value, allowed)
        if run.curve[0].robot_steps > steps:
            given = f"validated after {run.curve[0].robot_steps:,.0f} robot-steps at first"
            allowed = f"a validation within {steps:,.0f}, the shortest run"
            raise SettingError(f"runs: {run.command}", given, allowed)


def _alike(one: object, other: object) -> bool:
    """Whether settings are the same; those that an earlier version had not are not compared."""
    if isinstance(one, dict) and isinstance(other, dict):
        return all(_alike(one[name], other[name]) for name in one.keys() & other.keys())
    return one == other


def read_run(folder: Path) -> Run:
    """A run, from what its folder holds.

    Raises:
        SettingError: It is no folder of a run, or of one that has not been validated.
    """
    try:
        started = json.loads((folder / FILE).read_text("utf-8"))
        module, args = started["command"].split()[2], started["args"]
        with (folder / "curve.csv").open(encoding="utf-8", newline="") as file:
            curve = [
                Validated(float(row[_STEPS[module]]), float(row["mean_s"]), float(row["median_s"]))
                for row in csv.DictReader(file)
            ]
    except (OSError, ValueError, LookupError) as error:
        allowed = f"a folder of a run of {' or '.join(_STEPS)} that has been validated ({error!r})"
        raise SettingError("runs", str(folder), allowed) from None
    if not curve:
        raise SettingError("runs", str(folder), "a folder of a run that has been validated")
    return Run(
        started["command"],
        _trainer(module, args),
        {name: args.get(name) for name in _TASK},
        args["seed"],
        curve,
    )


def _trainer(module: str, args: dict[str, Any]) -> str:
    if module == "training.ppo":
        return "Stable-Baselines3"
    runners = args["runners"]
    return "RLlib, no runner" if runners == 0 else f"RLlib, {runners} runner{'s' * (runners > 1)}"


def by_trainer(runs: Sequence[Run]) -> dict[str, list[Run]]:
    """Trainer → its runs, in the order given."""
    return {
        name: [run for run in runs if run.trainer == name] for name in dict.fromkeys(r.trainer for r in runs)
    }


def page(runs: Sequence[Run]) -> str:
    """The page, as Markdown."""
    steps = math.floor(min(run.curve[-1].robot_steps for run in runs))
    first, *_ = trainers = by_trainer(runs)
    reference = np.median([run.best_by(steps).median_s for run in trainers[first]])
    rows = []
    for name, each in trainers.items():
        times = [run.best_by(steps).median_s for run in each]
        share = float(np.median(times) / reference)
        cells = [name, ", ".join(f"{time:.1f}" for time in times), f"{np.median(times):.1f}"]
        rows.append(
            [*cells, *(("", "") if name == first else (f"{share:.2f}", "yes" if share <= GOAL else "no"))]
        )
    head = ["trainer", "median mission time of each seed, s", "median of these", "ratio", f"≤ {GOAL:g}"]
    team = counted(runs[0].task["robots"], "robot")
    commands = "\n".join(f"    {run.command}" for run in runs)
    return "\n".join(
        [
            "# What trainers learn in the same number of steps\n",
            "Made by `python -m training.trainer_comparison`, the folders of these runs after it:\n",
            commands + "\n",
            f"The scenario {runs[0].task['scenario']} with {team}. All validate in "
            "the same missions, which they do not learn from. The table has the policy that each run keeps "
            f"after {steps:,} robot-steps, which all of them reached: the one with the least mean time so "
            f"far. A ratio is that of medians, to {first}. Learning rates fall until a run's last step.\n",
            markdown_table(head, rows),
            "![Mission time in validations over robot-steps](trainers/curves.png)\n",
        ]
    )


if __name__ == "__main__":
    raise SystemExit(run_command(main))
