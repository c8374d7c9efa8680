"""What proofs share: cases played in a process of their own, commands that are killed, drawn steps."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces

from baselines.experiments.worker_pool import Failure, place_of, run_each
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.simulation import Missions

ROOT = Path(__file__).parents[2]
"""The checkout."""
_WAIT_S = 900.0


class BrokenPromiseError(AssertionError):
    """Something happened that the library promises never to do."""


class Found(NamedTuple):
    """What a case came to.

    Attributes:
        figures: Name → number. The page adds them up over all cases, or, where the name ends with "at most",
            shows the largest.
        of: Group of cases that has a row of its own in the table, such as a file format; empty = none.
    """

    figures: dict[str, float]
    of: str = ""


def play_cases(
    play: Callable[[int], Found], numbers: Sequence[int], limit_s: float
) -> Iterator[tuple[int, Found | str]]:
    """Yield each case's number with what it found, or with one line on why it failed.

    What plays a case is a function at the top of a module. A case may take `limit_s` on the clock.
    """
    for number, outcome in run_each(play, numbers, 1, limit_s, apart=True):
        if isinstance(outcome, Failure):
            yield number, outcome.reason[:2000] + place_of(outcome.trace)
        else:
            yield number, outcome


class Command(NamedTuple):
    """A command of this checkout: its module, its options, and the Python that runs it."""

    module: str
    words: Sequence[str]
    python: str = sys.executable

    def kill_when(self, happened: Callable[[], bool], delay_s: float) -> None:
        """Run it until something has happened and some seconds more, and kill it with all its processes.

        Raises:
            BrokenPromiseError: It ends before, or nothing happens for a quarter of an hour.
        """
        begun_s = time.monotonic()
        with self._started(subprocess.DEVNULL) as child:
            try:
                while not happened():
                    if child.poll() is not None:
                        raise BrokenPromiseError(
                            f"{self.module} ended with {child.returncode} before it was to be killed"
                        )
                    if time.monotonic() - begun_s > _WAIT_S:
                        raise BrokenPromiseError(f"{self.module} did nothing for {_WAIT_S:g} s")
                    time.sleep(0.001)
                time.sleep(delay_s)
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(child.pid, signal.SIGKILL)

    def finish(self) -> None:
        """Run it to its end.

        Raises:
            BrokenPromiseError: It ends with an error.
        """
        with self._started(subprocess.PIPE) as child:
            said = child.communicate()[1]
        if child.returncode:
            raise BrokenPromiseError(f"{self.module} ended with {child.returncode}: {said[-300:]}")

    def _started(self, stderr: int) -> subprocess.Popen[str]:
        """Return it in a process group of its own."""
        return subprocess.Popen(
            [self.python, "-m", self.module, *self.words],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            text=True,
            start_new_session=True,
        )


def walk(missions: Missions, rng: np.random.Generator, steps: int, alike: bool = False) -> None:
    """Take some steps with drawn actions, which may be alike in all missions."""
    team, space = (1 if alike else missions.count, missions.scenario.robots), action_space(missions.scenario)
    choices, repeats = int(space.n) if isinstance(space, spaces.Discrete) else 1, missions.count // team[0]
    for _ in range(steps):
        boxes = rng.uniform(-1.0, 1.0, (*team, 5)).astype(np.float32).astype(np.float64)
        numbers = rng.integers(0, choices, team)
        missions.step(np.repeat(boxes, repeats, axis=0), np.repeat(numbers, repeats, axis=0))


def check_step(missions: Missions, rewards: Iterable[Any], said: str = "") -> None:
    """Raise a BrokenPromiseError if an observation is outside its space, or a reward is not finite."""
    layout, seen = missions.layout, missions.observations
    within = (seen >= layout.low.astype(np.float32)) & (seen <= layout.high.astype(np.float32))
    for place in np.argwhere(~within)[:1]:
        where = f"{seen[tuple(place)]!r} at {place.tolist()} of {list(layout.parts)}"
        raise BrokenPromiseError(f"an observation is {where}, outside its space: {said or missions.scenario}")
    for each in rewards:
        if not np.isfinite(each).all():
            raise BrokenPromiseError(f"a reward is not finite: {each}: {said or missions.scenario}")
