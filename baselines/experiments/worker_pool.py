"""Tasks in processes, or on a cluster: none can take the others down, each may have a limit on the clock.

A task that raises, runs past its limit or ends its process is a Failure in its place. The processes are a
pool of pebble's, which ends and replaces those that are late or gone.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import multiprocessing
import os
import pickle
import re
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError  # another one in Python 3.10
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from types import FrameType
from typing import Any, TypeVar

from pebble import ProcessExpired, ProcessPool

from baselines.experiments.ray_cluster import RayCluster

Task = TypeVar("Task")
Result = TypeVar("Result")

_AGAIN_S = 1.0
"""The alarm rings again so often, should a task have swallowed it."""


@dataclass(frozen=True)
class Failure:
    """Why a task has no result.

    Attributes:
        reason: One line.
        late: Whether it ran past its limit.
        error: What it raised, if that could be passed on.
        trace: Where.
    """

    reason: str
    late: bool = False
    error: Exception | None = None
    trace: str = ""

    def throw(self) -> None:
        """Raise what the task raised, with the trace of its process as the cause."""
        raise (self.error or RuntimeError(self.reason)) from RuntimeError(self.trace or self.reason)


def run_each(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    workers: int | RayCluster,
    limit_s: float = math.inf,
    apart: bool = False,
) -> Generator[tuple[Task, Result | Failure], None, None]:
    """Do the work for every task, and yield results as they come.

    With one process the work is done in this one, under an alarm: ending a late process would cost the next
    task 3-5 s of imports and kernels. The alarm rings between Python's instructions: compiled code that never
    returns is ended with two processes or more only, apart, or on a cluster.

    Args:
        work: A function at the top of a module; what it returns can be pickled.
        tasks: What it takes, likewise.
        workers: How many processes of this machine, or a Ray cluster.
        limit_s: Of every task, on the clock from when it is begun; inf = none.
        apart: Work in a process of its own also where there is one.
    """
    if isinstance(workers, RayCluster):
        from baselines.experiments.ray_pool import run_on_cluster

        yield from run_on_cluster(work, tasks, workers, limit_s)
    elif workers == 1 and not apart:
        yield from ((task, _attempt_in_time(work, task, limit_s)) for task in tasks)
    elif tasks:
        yield from _run_in_processes(work, tasks, min(workers, len(tasks)), limit_s)


def _run_in_processes(
    work: Callable[[Any], Any], tasks: Sequence[Task], jobs: int, limit_s: float
) -> Generator[tuple[Task, Any], None, None]:
    pool = ProcessPool(jobs, initializer=_follow_parent, context=multiprocessing.get_context("spawn"))
    done: SimpleQueue[Future[bytes]] = SimpleQueue()
    timeout = None if math.isinf(limit_s) else limit_s
    try:
        waiting: dict[Future[bytes], Task] = {
            pool.schedule(attempt_packed, (work, task), timeout=timeout): task for task in tasks
        }
        for future in waiting:
            future.add_done_callback(done.put)
        for _ in tasks:
            future = done.get()
            yield waiting[future], _outcome(future, limit_s)
    finally:
        pool.stop()
        pool.join()


def _outcome(future: Future[bytes], limit_s: float) -> Any:  # noqa: ANN401 - whatever the work returns
    """Return the result of a task, or its failure."""
    try:
        return pickle.loads(future.result())
    except FutureTimeoutError:
        return late(limit_s)
    except ProcessExpired as error:
        return Failure(_ending(error.exitcode))
    except Exception as error:  # the task cannot be passed on, or its result not be read
        return failure_of(error)


def place_of(trace: str) -> str:
    """Return file and line where an error was raised, as ` (file.py, line 3)`; empty without a trace."""
    frames = re.findall(r'File "([^"]+)", line (\d+)', trace)
    return f" ({Path(frames[-1][0]).name}, line {frames[-1][1]})" if frames else ""


def _ending(code: int) -> str:
    """Return how a process ended, from its exit code."""
    if code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended with exit code {code}"


def failure_of(error: Exception) -> Failure:
    """Return the failure of a task that could not be passed on or started."""
    return Failure(_one_line(error), error=error)


def late(limit_s: float) -> Failure:
    """Return the failure of a task that ran past its limit."""
    return Failure(f"ran past {limit_s:g} s on the clock", late=True)


def _attempt_in_time(work: Callable[[Any], Any], task: object, limit_s: float) -> Any:  # noqa: ANN401
    """Run a task in this process under its time limit; return its result or its failure."""
    try:
        with _alarm(limit_s):
            return _attempt(work, task)
    except _AlarmError:
        return late(limit_s)


class _AlarmError(BaseException):
    """The time is up; no Exception, so that no task takes it for an error of its own."""


@contextlib.contextmanager
def _alarm(limit_s: float) -> Iterator[None]:
    """Raise an _AlarmError in what runs inside once the time is up, where the system has such an alarm."""
    main = threading.current_thread() is threading.main_thread()
    if math.isinf(limit_s) or not main or not hasattr(signal, "setitimer"):
        yield
        return

    def ring(number: int, frame: FrameType | None) -> None:
        del number, frame
        if running:
            raise _AlarmError

    before, running = signal.signal(signal.SIGALRM, ring), True
    try:
        try:
            signal.setitimer(signal.ITIMER_REAL, limit_s, _AGAIN_S)
            yield
        finally:
            running = False
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _attempt(work: Callable[[Any], Any], task: object) -> Any:  # noqa: ANN401 - the work's
    """Run a task; return its result or its failure."""
    try:
        return work(task)
    except (Exception, SystemExit) as error:
        kept = error if isinstance(error, Exception) else None
        return Failure(_one_line(error), error=kept, trace=traceback.format_exc())


def _one_line(error: BaseException) -> str:
    """Return the kind and message of an error."""
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def attempt_packed(work: Callable[[Any], Any], task: object, limit_s: float = math.inf) -> bytes:
    """Run a task in a worker; return its result or failure pickled, also where that cannot be pickled."""
    outcome = _attempt_in_time(work, task, limit_s)
    try:
        packed = pickle.dumps(outcome)
        if isinstance(outcome, Failure):
            pickle.loads(packed)
    except Exception as error:
        bare = Failure(_one_line(error)) if not isinstance(outcome, Failure) else outcome
        packed = pickle.dumps(dataclasses.replace(bare, error=None))
    return packed


def _follow_parent() -> None:
    """End this process as soon as the one that started it is gone."""
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
