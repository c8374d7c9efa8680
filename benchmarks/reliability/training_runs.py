"""Training runs of a million robot-steps, killed and resumed: they end, and all their numbers are finite.

A case is a run of `training.ppo`, the next one of `training.rllib_ppo`. RLlib needs an environment of its
own: where it is not installed here, its run takes the Python of `.venv-rllib` in the checkout.
"""

from __future__ import annotations

import csv
import importlib.util
import math
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.reliability.settings_fuzz import BrokenPromiseError

ROBOT_STEPS = 1_000_000
"""Of a run."""
KILLS = 3
"""Of a run, at drawn moments."""
_ROOT = Path(__file__).parents[2]
_MAY_BE_MISSING = ("bits_per_bit", "planner_ratio")
"""Columns that are empty where nothing was sent, and where no planner proposes what is chosen."""


class Trainer(NamedTuple):
    """A command that trains.

    Attributes:
        words: Its options.
        checkpoints: The pattern of their names.
        column: Of its curve: robot-steps.
        needs: A module that not every environment has: of RLlib, one that Ray alone does not bring.
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
_MOST_CHECKPOINTS = 4
"""After at most so many more a run is killed again."""
_WAIT_S = 900.0


def play_number(number: int) -> dict[str, Any]:
    """Train to the end, with KILLS kills on the way.

    Raises:
        BrokenPromiseError: A run ends with an error or too early, or one of its numbers is not finite.
    """
    name, moments = list(TRAINERS)[number % len(TRAINERS)], random.Random(number)
    words = ("--scenario", "box-7x11x5", "--robots", "3", "--seed", str(number))
    with tempfile.TemporaryDirectory() as folder:
        return train(name, Path(folder) / "run", (*words, "--total-steps", str(ROBOT_STEPS)), KILLS, moments)


def train(name: str, run: Path, words: tuple[str, ...], kills: int, moments: random.Random) -> dict[str, Any]:
    """Train in a folder, kill the trainer and resume it so many times, and look at what it wrote.

    Args:
        name: Of the trainer.
        run: Its folder.
        words: Its options.
        kills: How often.
        moments: When is drawn from this.

    Raises:
        BrokenPromiseError: See play_number.
    """
    trainer, kept = TRAINERS[name], []
    words = (*trainer.words, *words, "--out", str(run))
    for _ in range(kills):
        kept.append(_killed(name, words, run, moments))
        words = ("--resume", str(run))
    with tempfile.TemporaryFile("w+") as said, _started(name, words, said) as last:
        code = last.wait()
        said.seek(0)
        if code:
            raise BrokenPromiseError(f"{name} ended with {code}: {said.read()[-300:]}")
    steps = check_curve(run / "curve.csv", trainer.column)
    check_policy(run)
    return {"trainer": name, "kills": kills, "checkpoints_before": kept, "robot_steps": steps}


def _killed(name: str, words: tuple[str, ...], run: Path, moments: random.Random) -> int:
    """Start a trainer and kill it, and all that it started, after some checkpoints; how many it has then."""
    pattern, begun_s = TRAINERS[name].checkpoints, time.monotonic()
    seen = set(run.glob(pattern))
    wanted = moments.randint(1, _MOST_CHECKPOINTS)
    written: set[Path] = set()
    with _started(name, words, subprocess.DEVNULL) as child:
        while len(written) < wanted:
            if child.poll() is not None:
                raise BrokenPromiseError(f"{name} ended with {child.returncode} before it was to be killed")
            if time.monotonic() - begun_s > _WAIT_S:
                os.killpg(child.pid, signal.SIGKILL)
                raise BrokenPromiseError(f"{name} wrote no checkpoint for {_WAIT_S:g} s")
            written |= set(run.glob(pattern)) - seen
            time.sleep(0.05)
        time.sleep(moments.uniform(0.0, 3.0))
        os.killpg(child.pid, signal.SIGKILL)
    return len(written | seen)


def _started(name: str, words: tuple[str, ...], said: Any) -> subprocess.Popen[Any]:  # noqa: ANN401 - a file
    """A trainer in a group of processes of its own."""
    return subprocess.Popen(
        [_python(TRAINERS[name].needs), "-m", name, *words],
        cwd=_ROOT,
        env={**os.environ, "PYTHONPATH": str(_ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=said,
        start_new_session=True,
    )


def _python(module: str) -> str:
    """This interpreter, or that of the environment of RLlib where it lacks a module."""
    return (
        sys.executable if importlib.util.find_spec(module) else str(_ROOT / ".venv-rllib" / "bin" / "python")
    )


def check_curve(curve: Path, column: str) -> int:
    """Check that all figures of a run's validations are finite; its robot-steps.

    Raises:
        BrokenPromiseError: One is not.
    """
    with curve.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        for figure, cell in row.items():
            if not (cell == "" and figure in _MAY_BE_MISSING) and not math.isfinite(float(cell)):
                raise BrokenPromiseError(f"{figure} is {cell} after {row[column]} steps")
    return int(float(rows[-1][column]))


def check_policy(run: Path) -> None:
    """Check that all weights of the policy that a run keeps are finite.

    Raises:
        BrokenPromiseError: One is not.
    """
    from training.checkpoints import latest_checkpoint, load_checkpoint

    for weights, tensor in load_checkpoint(latest_checkpoint(run, "best")).weights.items():
        if not tensor.isfinite().all():
            raise BrokenPromiseError(f"{weights} holds a number that is not finite")
