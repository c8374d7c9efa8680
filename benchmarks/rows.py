"""Rows of the speed table: what we do, what a peer does, and the ratio that is to be reached.

Other work on the machine slows both down. So each job and its peer are measured in turns, round by round, and
the ratio is the median of the rounds' ratios. One thread is timed by its processor time; two threads and
fresh processes are timed by the wall clock.
"""

from __future__ import annotations

import operator
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

_COMPARE = {"≥": operator.ge, "≤": operator.le, "<": operator.lt, "=": operator.eq}


@dataclass(frozen=True)
class Taken:
    """Seconds that some work took: of this thread's processor time, and by the wall clock."""

    cpu_s: float
    wall_s: float


Job = Callable[[int], Taken]
"""Does its work in round k."""


def timed(work: Callable[[], object]) -> Taken:
    """Do some work and time it."""
    wall, cpu = time.perf_counter(), time.thread_time()
    work()
    cpu_s = time.thread_time() - cpu
    return Taken(cpu_s, time.perf_counter() - wall)


@dataclass(frozen=True)
class Effort:
    """How much is measured.

    Attributes:
        scans: Scans that are fused in a round.
        rounds: Rounds of jobs that take less than a second.
        long_rounds: Rounds of jobs that may take seconds.
        steps: Steps of an environment in a round.
        missions: Missions E of the vector environments.
        starts: Fresh processes.
        large: Whether what takes minutes is measured, too.
    """

    scans: int = 400
    rounds: int = 21
    long_rounds: int = 9
    steps: int = 600
    missions: tuple[int, ...] = (1, 16, 64, 256)
    starts: int = 5
    large: bool = True


FULL = Effort()
QUICK = Effort(scans=200, rounds=7, long_rounds=3, steps=200, starts=1, large=False)


@dataclass(frozen=True)
class Goal:
    """What a row is to reach: the sign, the limit and the limit's unit (× for ratios)."""

    sign: str
    limit: float
    unit: str = "×"

    @property
    def text(self) -> str:
        """Such as "≥ 5 ×"."""
        return f"{self.sign} {self.limit:g} {self.unit}"

    def holds(self, value: float) -> bool:
        """Return whether a value reaches it."""
        return bool(_COMPARE[self.sign](value, self.limit))


@dataclass(frozen=True)
class Row:
    """One line of the table; None where there is no peer, no ratio or no goal."""

    job: str
    peer: str | None
    ours: float
    theirs: float | None
    unit: str
    ratio: float | None
    goal: str | None
    holds: bool | None


def interleave(jobs: Mapping[str, Job], rounds: int) -> dict[str, list[Taken]]:
    """Let the jobs take turns, A B A B; returns what each took in every round."""
    measured: dict[str, list[Taken]] = {name: [] for name in jobs}
    for number in range(rounds):
        for name, job in jobs.items():
            measured[name].append(job(number))
    return measured


def compared(
    job: str, peer: str, ours: Sequence[float], theirs: Sequence[float], unit: str, goal: Goal | None = None
) -> Row:
    """Return the row of a job beside a peer; the goal is about the ratio ours/theirs."""
    ratio = float(statistics.median(a / b for a, b in zip(ours, theirs, strict=True)))
    medians = float(statistics.median(ours)), float(statistics.median(theirs))
    text, holds = (None, None) if goal is None else (goal.text, goal.holds(ratio))
    return Row(job, peer, *medians, unit, ratio, text, holds)


def alone(job: str, values: Iterable[float], unit: str, goal: Goal | None = None) -> Row:
    """Return the row of a job without a peer; the goal is about the median itself."""
    value = float(statistics.median(values))
    text, holds = (None, None) if goal is None else (goal.text, goal.holds(value))
    return Row(job, None, value, None, unit, None, text, holds)
