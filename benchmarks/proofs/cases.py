"""Cases of proofs: numbers that are played one after the other in a process of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from baselines.experiments.worker_pool import Failure, place_of, run_each
from entropy_explore_env.missions.simulation import Missions


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

    Args:
        play: Plays the case of a number; a function at the top of a module.
        numbers: Of the cases.
        limit_s: Elapsed seconds that a case may take.
    """
    for number, outcome in run_each(play, numbers, 1, limit_s, apart=True):
        if isinstance(outcome, Failure):
            yield number, outcome.reason[:2000] + place_of(outcome.trace)
        else:
            yield number, outcome


def check_step(missions: Missions, rewards: Iterable[Any]) -> None:
    """Check what missions have observed and been given in a step.

    Args:
        missions: After the step.
        rewards: Numbers or arrays.

    Raises:
        BrokenPromiseError: An observation is outside its space, or a reward is not finite.
    """
    layout, seen = missions.layout, missions.observations
    within = (seen >= layout.low.astype(np.float32)) & (seen <= layout.high.astype(np.float32))
    for place in np.argwhere(~within)[:1]:
        where = f"{seen[tuple(place)]!r} at {place.tolist()} of {list(layout.parts)}"
        raise BrokenPromiseError(f"an observation is {where}, outside its space: {missions.scenario}")
    for each in rewards:
        if not np.isfinite(each).all():
            raise BrokenPromiseError(f"a reward is not finite: {each}: {missions.scenario}")
