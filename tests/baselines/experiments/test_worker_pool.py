"""Tasks in processes: results, errors, limits and processes that end, none of which stops the others."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from baselines.experiments.worker_pool import Failure, run_each
from entropy_explore_env.errors import SettingError
from tests.systems import needs_posix

ROOT = Path(__file__).parents[3]


class ParticularError(Exception):
    """Pickled without a word, it cannot be read again: it asks for two arguments."""

    def __init__(self, one: str, two: str) -> None:
        super().__init__(f"{one}\n{two}")


def work(task):
    """What a task's first word says, done in whatever process."""
    match task:
        case "square", number:
            return number**2
        case "raise", _:
            raise SettingError("field", 3, "less")
        case "particular", _:
            raise ParticularError("one", "two  words")
        case "stubborn", _:
            raise StubbornError
        case "lambda", _:
            return lambda: None
        case "leave", _:
            sys.exit(3)
        case "swallow", _:
            while True:
                try:
                    time.sleep(0.01)
                except Exception:
                    pass
        case "hang", _:  # in code that Python's alarm does not reach
            ctypes.PyDLL(None).usleep(60_000_000)
        case "die", code:
            os._exit(code)
        case "kill", number:
            os.kill(os.getpid(), number)


def outcomes(tasks, jobs, limit_s=float("inf")):
    found = dict(run_each(work, tasks, jobs, limit_s))
    assert len(found) == len(tasks)
    return found


SQUARES = [("square", number) for number in range(5)]


@pytest.mark.parametrize("jobs", [1, 2, 9])
def test_every_task_has_its_result(jobs):
    assert outcomes(SQUARES, jobs) == {task: task[1] ** 2 for task in SQUARES}
    assert outcomes([], jobs) == {}


@pytest.mark.parametrize("jobs", [1, 2])
def test_errors_are_failures_in_their_place(jobs):
    tasks = [("raise", 0), SQUARES[3], ("particular", 0), ("leave", 0), SQUARES[4]]
    found = outcomes(tasks, jobs)
    assert (found[SQUARES[3]], found[SQUARES[4]]) == (9, 16)
    assert found["raise", 0].reason == "SettingError: field = 3: expected less"
    assert isinstance(found["raise", 0].error, SettingError) and not found["raise", 0].late
    assert found["particular", 0].reason == "ParticularError: one two words"
    assert found["leave", 0].reason == "SystemExit: 3"
    with pytest.raises(SettingError, match="expected less") as raised:
        found["raise", 0].throw()
    assert "in work" in str(raised.value.__cause__)  # where it was
    with pytest.raises(RuntimeError, match="SystemExit"):
        found["leave", 0].throw()


class StubbornError(Exception):
    """Cannot be pickled at all."""

    def __init__(self) -> None:
        super().__init__("stubborn")
        self.kept = lambda: None


def test_what_cannot_be_passed_on_is_a_failure_of_its_task_alone():
    """A result or an error that cannot be pickled, and a task that cannot be."""
    found = outcomes([("stubborn", 0), ("lambda", 0), SQUARES[2], SQUARES[4]], 2)
    assert found["stubborn", 0].reason == "StubbornError: stubborn" and found["stubborn", 0].error is None
    assert "pickle" in found["lambda", 0].reason
    assert (found[SQUARES[2]], found[SQUARES[4]]) == (4, 16)


@pytest.mark.parametrize("jobs", [pytest.param(1, marks=needs_posix), 2])
def test_a_task_that_runs_past_its_limit_is_ended_even_if_it_catches_all_errors(jobs):
    found = outcomes([SQUARES[2], ("swallow", 0), SQUARES[3]], jobs, 0.3)
    assert found[SQUARES[2]] == 4 and found[SQUARES[3]] == 9
    assert found["swallow", 0] == Failure("ran past 0.3 s on the clock", late=True)


@needs_posix
def test_the_alarm_is_off_after_a_task():
    before = signal.getsignal(signal.SIGALRM)
    assert outcomes(SQUARES, 1, 0.05)[SQUARES[4]] == 16
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) is before


@needs_posix
def test_a_process_that_hangs_or_ends_is_replaced():
    tasks = [("hang", 0), ("die", 7), ("kill", int(signal.SIGSEGV)), ("kill", int(signal.SIGKILL)), *SQUARES]
    started = time.monotonic()
    found = outcomes(tasks, 2, 1.0)
    assert time.monotonic() - started < 50.0  # not the minute for which one hangs
    assert all(found[task] == task[1] ** 2 for task in SQUARES)
    assert found["hang", 0] == Failure("ran past 1 s on the clock", late=True)
    assert found["die", 7].reason == "its process ended with exit code 7"
    assert found["kill", int(signal.SIGSEGV)].reason == "its process was ended by SIGSEGV"
    assert found["kill", int(signal.SIGKILL)].reason == "its process was ended by SIGKILL"
    assert multiprocessing.active_children() == []


def test_who_stops_asking_leaves_no_process_behind():
    results = run_each(work, [*SQUARES, ("swallow", 0), ("swallow", 1)], 2)
    next(results)
    assert multiprocessing.active_children() != []
    results.close()
    assert multiprocessing.active_children() == []


ORPHANED = """
import multiprocessing, os, signal, sys
sys.path.insert(0, "tests/baselines/experiments")
from test_worker_pool import work
from baselines.experiments.worker_pool import run_each

if __name__ == "__main__":
    results = run_each(work, [("square", 1), ("swallow", 0), ("swallow", 1)], 2)
    next(results)
    print(*(child.pid for child in multiprocessing.active_children()), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks processes up in /proc")
def test_nobody_works_on_for_a_command_that_was_killed(tmp_path):
    script = tmp_path / "orphaned.py"
    script.write_text(ORPHANED)
    words = [sys.executable, str(script)]
    ran = subprocess.run(
        words, cwd=ROOT, env={**os.environ, "PYTHONPATH": "."}, capture_output=True, text=True
    )
    assert ran.returncode == -signal.SIGKILL
    children = [int(word) for word in ran.stdout.split()]
    assert len(children) == 2
    until = time.monotonic() + 30.0
    while any(map(works, children)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(works, children))


def works(process: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_an_interruption_goes_through():
    def interrupted(_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(run_each(interrupted, [1, 2], 1))
