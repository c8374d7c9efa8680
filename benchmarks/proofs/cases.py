"""Cases of proofs: numbers that are played one after the other, under a watchdog."""

from __future__ import annotations

import multiprocessing
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import TimeoutError as FutureTimeoutError  # another class in Python 3.10
from pathlib import Path
from typing import NamedTuple

from pebble import ProcessExpired, ProcessPool


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

    A process of its own plays them. It is replaced where a case ends it or runs past its limit.

    Args:
        play: Plays the case of a number; a function at the top of a module.
        numbers: Of the cases.
        limit_s: Elapsed seconds that a case may take.
    """
    pool = ProcessPool(1, context=multiprocessing.get_context("spawn"))
    try:
        for number in numbers:
            future = pool.schedule(_attempt, (play, number), timeout=limit_s)
            try:
                yield number, future.result()
            except FutureTimeoutError:
                yield number, f"ran past {limit_s:g} s"
            except ProcessExpired as error:
                yield number, f"its process ended with exit code {error.exitcode}"
    finally:
        pool.stop()
        pool.join()


def _attempt(play: Callable[[int], Found], number: int) -> Found | str:
    """Play a case; return an error as text, because not every exception can be passed between processes."""
    try:
        return play(number)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        said = " ".join(f"{type(error).__name__}: {error}".split())
        return f"{said[:2000]} ({Path(place.filename).name}:{place.lineno})"
