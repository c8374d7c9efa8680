"""Training runs of a million robot-steps, killed and resumed: they end, and all their numbers are finite.

Cases take turns with `training.ppo` and `training.rllib_ppo`. RLlib needs an environment of its own: where it
is not installed beside this command, its run takes the Python of `.venv-rllib` in the checkout.
"""

from __future__ import annotations

import csv
import importlib.util
import math
import random
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from benchmarks.proofs.cases import ROOT, BrokenPromiseError, Command, Found

ROBOT_STEPS, KILLS = 1_000_000, 3
"""Of a run."""
_MAY_BE_MISSING = ("bits_per_bit", "planner_ratio")
"""Columns that are empty where nothing was sent, and where no planner proposes candidates."""
_MOST_CHECKPOINTS = 4
"""Most further checkpoints after which a run is killed again."""


class Trainer(NamedTuple):
    """A command that trains.

    Attributes:
        words: Its options.
        checkpoints: Pattern of their names.
        column: Column of its curve that holds robot-steps.
        needs: A module that only environments with this trainer have.
    """

    words: tuple[str, ...]
    checkpoints: str
    column: str
    needs: str


TRAINERS = {
    "training.ppo": Trainer(
        ("--checkpoint-every", "50_000", "--threads", "1", "--no-video"), "step-*", "steps", "torch"
    ),
    "training.rllib_ppo": Trainer(
        ("--checkpoint-every", "2", "--runners", "1"), "checkpoint-*", "robot_steps", "tree"
    ),
}


def play(number: int) -> Found:
    """Train to the end, with KILLS kills on the way.

    Raises:
        BrokenPromiseError: A run ends with an error or too early, or one of its numbers is not finite.
    """
    name, moments = list(TRAINERS)[number % len(TRAINERS)], random.Random(number)
    words = ("--scenario", "box-7x11x5", "--robots", "3", "--seed", str(number % 2**31))
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        steps = train(name, run, (*words, "--total-steps", str(ROBOT_STEPS)), KILLS, moments)
    return Found({"robot-steps": steps, "kills": KILLS}, name)


def train(name: str, run: Path, words: tuple[str, ...], kills: int, moments: random.Random) -> int:
    """Train in a folder, kill and resume the trainer at drawn moments; returns the robot-steps.

    Raises:
        BrokenPromiseError: See play.
    """
    words, pattern = (*TRAINERS[name].words, *words, "--out", str(run)), TRAINERS[name].checkpoints
    here = importlib.util.find_spec(TRAINERS[name].needs) is not None
    python = sys.executable if here else str(ROOT / ".venv-rllib" / "bin" / "python")
    for _ in range(kills):
        seen, written, wanted = set(run.glob(pattern)), set[Path](), moments.randint(1, _MOST_CHECKPOINTS)

        def all_written(seen: set[Path] = seen, written: set[Path] = written, wanted: int = wanted) -> bool:
            written |= set(run.glob(pattern)) - seen
            return len(written) >= wanted

        Command(name, words, python).kill_when(all_written, moments.uniform(0.0, 3.0))
        words = ("--resume", str(run))
    Command(name, words, python).finish()
    check_policy(run)
    return check_curve(run / "curve.csv", TRAINERS[name].column)


def check_curve(curve: Path, column: str) -> int:
    """Return the robot-steps of a run; a BrokenPromiseError says which of its figures is not finite."""
    with curve.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        for figure, cell in row.items():
            if not (cell == "" and figure in _MAY_BE_MISSING) and not math.isfinite(float(cell)):
                raise BrokenPromiseError(f"{figure} is {cell} after {row[column]} steps")
    return int(float(rows[-1][column]))


def check_policy(run: Path) -> None:
    """Raise a BrokenPromiseError unless all weights of the policy that a run keeps are finite."""
    from training.checkpoints import latest_checkpoint, load_checkpoint

    for weights, tensor in load_checkpoint(latest_checkpoint(run, "best")).weights.items():
        if not tensor.isfinite().all():
            raise BrokenPromiseError(f"{weights} holds a number that is not finite")
