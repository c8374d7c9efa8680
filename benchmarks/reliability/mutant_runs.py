"""Tests run for one fault after another, each time in a fork of a process that has imported much already.

Most of the time of a short test is spent on imports. So the process imports all that the library and its
tests need and that is not of the checkout; a fork of it imports the library, with the fault in it, and runs
the tests.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from benchmarks.reliability.quick_tests import LIMIT, TooSlowError

_OWN = ("entropy_explore_env", "baselines", "training", "benchmarks", "tests", "conftest", "docs", "__main__")
"""Packages of the checkout, which a fork imports anew."""
_OLD_S = 1e9
"""Time of sources that are sound, long ago, so that one that was changed is never taken for them."""
_TEST_S = 10.0
"""Of the processor, that a test may take with a fault."""
LATE = "late"


class First(NamedTuple):
    """The test that failed first."""

    test: str
    """Its name; where all tests together took too long or ended the process, what became of them."""
    late: bool = False
    """Whether it took too long."""


class Host:
    """A process that runs tests in forks of itself, in a copy of the checkout.

    Attributes:
        folder: The copy.
    """

    def __init__(self, folder: Path) -> None:
        """Start the process.

        Args:
            folder: A copy of the checkout, whose sources may be changed.
        """
        self.folder = folder
        for path in folder.rglob("*.py"):
            os.utime(path, (_OLD_S, _OLD_S))
        variables = {**os.environ, "PYTHONPATH": str(folder), "NUMBA_DISABLE_JIT": "1", LIMIT: str(_TEST_S)}
        variables |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""}
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", "benchmarks.reliability.mutant_runs"],
            cwd=folder,
            env=variables,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._sound: dict[str, bool] = {}
        self._changes = 0

    def __enter__(self) -> Host:
        """The process itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the process."""
        del kind, error, trace
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()

    def first_failure(self, path: Path, source: str, tests: Sequence[str], limit_s: float) -> First | None:
        """Run tests with another text of a source.

        Args:
            path: Of the source, from the root of the checkout.
            source: Its text.
            tests: Names of tests, in their order.
            limit_s: On the clock, of all of them.

        Returns:
            The test that failed first; None where all passed.
        """
        file = self.folder / path
        sound = file.read_bytes()
        file.write_text(source, "utf-8")
        self._changes += 1  # Python takes what it compiled within a second for a file of equal size
        os.utime(file, (_OLD_S + self._changes, _OLD_S + self._changes))
        try:
            return self._ask(tests, limit_s)
        finally:
            file.write_bytes(sound)
            os.utime(file, (_OLD_S, _OLD_S))

    def passes_soundly(self, test: str, limit_s: float = 120.0) -> bool:
        """Whether a test passes, run alone without a fault; asked for once each."""
        if test not in self._sound:
            self._sound[test] = self._ask([test], limit_s) is None
        return self._sound[test]

    def _ask(self, tests: Sequence[str], limit_s: float) -> First | None:
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None and stdout is not None
        stdin.write(json.dumps({"tests": list(tests), "limit_s": limit_s}) + "\n")
        stdin.flush()
        answer = stdout.readline()
        if not answer:
            raise RuntimeError(f"the process of tests ended with exit code {self._process.wait()}")
        told = json.loads(answer)
        return First(told["failed"], told.get("late", False)) if told["failed"] else None


class _FirstFailure:
    """A plugin of pytest that notes which test failed first."""

    def __init__(self) -> None:
        """Nothing failed yet."""
        self.name: str | None = None
        self.late = False

    def pytest_runtest_logreport(self, report: Any) -> None:  # noqa: ANN401 - a report of pytest
        """Note the first failure."""
        if report.failed and self.name is None:
            self.name = report.nodeid
            self.late = TooSlowError.__name__ in str(report.longrepr)


def _tested(tests: Sequence[str]) -> dict[str, Any]:
    """Run tests in this process until one fails."""
    import pytest

    plugin = _FirstFailure()
    words = ["-q", "-x", "-W", "ignore", "-p", "no:cacheprovider", "-p", "benchmarks.reliability.quick_tests"]
    code = int(pytest.main([*words, *tests], plugins=[plugin]))
    failed = plugin.name or (None if code == 0 else f"exit code {code}")
    return {"failed": failed, "late": plugin.late}


def _modules(tests: Sequence[str]) -> dict[str, Any]:
    """Names of the modules of others that tests import, in the order of their import."""
    import pytest

    pytest.main(["-q", "--collect-only", "-W", "ignore", "-p", "no:cacheprovider", *tests])
    return {"modules": [name for name in sys.modules if name.partition(".")[0] not in _OWN]}


def _in_fork(work: Callable[[Sequence[str]], dict[str, Any]], tests: Sequence[str], limit_s: float) -> Any:  # noqa: ANN401
    """What some work returns in a fork of this process, with all that it starts; LATE past its limit."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        os.close(reading)
        nowhere = os.open(os.devnull, os.O_RDWR)
        for number in (0, 1, 2):
            os.dup2(nowhere, number)
        code = 1
        try:
            os.write(writing, json.dumps(work(tests)).encode())
            code = 0
        finally:
            os._exit(code)
    os.close(writing)
    answer, until_s = b"", time.monotonic() + limit_s
    while True:
        ready = select.select([reading], [], [], max(until_s - time.monotonic(), 0.0))[0]
        piece = os.read(reading, 1 << 16) if ready else b""
        if not piece:
            break
        answer += piece
    os.close(reading)
    late = not ready
    for group in (child, -child):
        try:
            os.kill(group, signal.SIGKILL) if late or group < 0 else None
        except (ProcessLookupError, PermissionError):
            pass
    status = os.waitpid(child, 0)[1]
    if late:
        return {"failed": LATE, "late": True}
    return json.loads(answer) if answer else {"failed": f"exit code {os.waitstatus_to_exitcode(status)}"}


def _prepare() -> None:
    """Import what is not of the checkout, as tests import it."""
    found = _in_fork(_modules, ["tests"], 600.0)
    for name in found.get("modules", ()):
        try:
            __import__(name)
        except BaseException:  # what only some can import
            continue
    for name in list(sys.modules):
        if name.partition(".")[0] in _OWN and name not in _KEPT:
            del sys.modules[name]


_KEPT = ("__main__", "benchmarks", "benchmarks.reliability", "benchmarks.reliability.quick_tests")


def _serve() -> None:
    """Answer each line of the standard input."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # nothing else is an answer
    _prepare()
    for line in sys.stdin:
        asked = json.loads(line)
        answer = _in_fork(_tested, asked["tests"], asked["limit_s"])
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    _serve()
