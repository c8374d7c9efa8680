"""A plugin of pytest for interpreted kernels: a clock for each test, and a list of those that passed.

A test that takes longer than QUICK_TEST_S of the processor fails, whatever it waits for. Names of tests that
pass are appended to the file QUICK_TESTS_PASSED, where that is set: the quickest can be run again.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Generator
from pathlib import Path
from types import FrameType

import pytest

LIMIT, PASSED = "QUICK_TEST_S", "QUICK_TESTS_PASSED"


class TooSlowError(BaseException):
    """A test took too long; no Exception, so that nothing of a test takes it for its own."""


def _ring(number: int, frame: FrameType | None) -> None:
    del number, frame
    raise TooSlowError("the test took too long")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Run a test under the clock."""
    del item
    before = signal.signal(signal.SIGPROF, _ring)
    signal.setitimer(signal.ITIMER_PROF, float(os.environ.get(LIMIT, "60")))
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note a test that passed."""
    file = os.environ.get(PASSED)
    if file and report.when == "call" and report.passed:
        with Path(file).open("a", encoding="utf-8") as passed:
            passed.write(f"{report.nodeid}\n")
