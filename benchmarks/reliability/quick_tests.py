"""A plugin of pytest for interpreted kernels: a clock for each test, and a list of what became of them.

Hypothesis draws a tenth of its examples, and takes the first that fails as it is. A test that takes longer
than QUICK_TEST_S of the processor, or forty times as long on the clock, fails, whatever it waits for. The
outcome of each test, its seconds and its name are appended to the file QUICK_TESTS_TOLD, where that is set:
the quickest can be run again. Where coverage is measured, it is told which test runs, and which is being set
up: what others of its file share may be made then.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NamedTuple

import pytest
from hypothesis import Phase, settings

LIMIT, TOLD = "QUICK_TEST_S", "QUICK_TESTS_TOLD"
SET_UP = " is set up"
"""Behind the name of a test, as coverage is told."""


_CLOCK = 40.0
"""Times the limit on the processor: what was ended may leave a lock behind, for which the next test waits."""
_AGAIN_S = 0.001
"""After which a clock that rang while coverage noted something rings again."""
_EXAMPLES = 10
"""Of Hypothesis, where the suite draws a hundred."""


class Told(NamedTuple):
    """What became of a test."""

    name: str
    passed: bool
    seconds: float
    """Of the processor."""


class TooSlowError(BaseException):
    """A test took too long; no Exception, so that nothing of a test takes it for its own."""


def _ring(number: int, frame: FrameType | None) -> None:
    """End the test; while coverage notes what it took, a little later.

    Coverage holds a lock while it notes a file. Ended there, it would never give the lock back, and wait for
    it where the next test begins; and Python no longer traces what a tracer that failed traced.
    """
    if _notes(frame):
        timer = signal.ITIMER_PROF if number == signal.SIGPROF else signal.ITIMER_REAL
        signal.setitimer(timer, _AGAIN_S)
        return
    raise TooSlowError("the test took too long")


def _notes(frame: FrameType | None) -> bool:
    """Whether coverage, called by what a test calls, runs in a frame; pytest itself runs in coverage."""
    name = ""
    while frame is not None and not name.startswith(("_pytest.", "coverage.")):
        name = str(frame.f_globals.get("__name__"))
        frame = frame.f_back
    return name.startswith("coverage.")


@pytest.hookimpl(trylast=True)
def pytest_configure() -> None:
    """Let Hypothesis draw few examples, and keep what the suite has settled of it."""
    phases = [Phase.explicit, Phase.generate]
    settings.register_profile("few", settings.default, max_examples=_EXAMPLES, phases=phases)
    settings.load_profile("few")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    """Tell coverage which test is set up."""
    with _context(item.nodeid + SET_UP):
        return (yield)


@contextmanager
def _context(name: str) -> Iterator[None]:
    """While what runs is told coverage by a name, where it is measured."""
    measuring = _measuring()
    if measuring is not None:
        measuring.switch_context(name)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        if measuring is not None:
            measuring.switch_context("")  # type: ignore[attr-defined]


def _measuring() -> object | None:
    """The coverage that is being measured, if any."""
    try:
        from coverage import Coverage
    except ImportError:
        return None
    return Coverage.current()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Run a test under the clocks."""
    limit_s = float(os.environ.get(LIMIT, "60"))
    with _context(item.nodeid):  # outside of the clocks: what coverage writes then is not ended half way
        before = [signal.signal(number, _ring) for number in (signal.SIGPROF, signal.SIGALRM)]
        signal.setitimer(signal.ITIMER_PROF, limit_s)
        signal.setitimer(signal.ITIMER_REAL, _CLOCK * limit_s)
        begun_s = time.process_time()
        try:
            return (yield)
        finally:
            for timer in (signal.ITIMER_PROF, signal.ITIMER_REAL):
                signal.setitimer(timer, 0.0)
            for number, handler in zip((signal.SIGPROF, signal.SIGALRM), before, strict=True):
                signal.signal(number, handler)
            item.user_properties.append(("seconds", time.process_time() - begun_s))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note what became of a test."""
    file = os.environ.get(TOLD)
    if file and report.when == "call":
        seconds = dict(report.user_properties).get("seconds", 0.0)
        with Path(file).open("a", encoding="utf-8") as told:
            told.write(f"{report.outcome}\t{seconds:.4f}\t{report.nodeid}\n")


def told_in(file: Path) -> list[Told]:
    """What is told in a file."""
    if not file.exists():
        return []
    lines = (line.split("\t", 2) for line in file.read_text("utf-8").splitlines())
    return [Told(name, outcome == "passed", float(seconds)) for outcome, seconds, name in lines]


def names_of(tests: Sequence[Told]) -> list[str]:
    """Of those that passed."""
    return [test.name for test in tests if test.passed]
