"""Tasks one after the other in a few processes: none can take the others down, each has a limit on the clock.

A task that raises, runs past its limit or ends its process is a Failure in its place.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import multiprocessing
import os
import pickle
import signal
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from types import FrameType
from typing import Any, TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")

_GRACE_S = 30.0
"""A process that is this much later than its limit, starting included, hangs and is ended from outside."""
_AGAIN_S = 1.0
"""The alarm rings again so often, should somebody have missed it."""


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


class _LateError(BaseException):
    """The alarm; no Exception, so that nobody takes it for an error of theirs."""


def run_each(
    work: Callable[[Task], Result], tasks: Sequence[Task], jobs: int, limit_s: float = math.inf
) -> Generator[tuple[Task, Result | Failure], None, None]:
    """Do the work for every task, and yield results as they come.

    With one job the work is done in this process. Its limit is an alarm there, which rings between
    Python's instructions: compiled code that never returns is ended with two jobs or more only.

    Args:
        work: A function at the top of a module; what it returns can be pickled.
        tasks: What it takes, likewise.
        jobs: Processes.
        limit_s: Of every task, on the clock; inf = none.
    """
    if jobs == 1:
        yield from ((task, _attempt(work, task, limit_s)) for task in tasks)
    elif tasks:
        yield from _run_in_processes(work, tasks, min(jobs, len(tasks)), limit_s)


def _attempt(work: Callable[[Any], Any], task: object, limit_s: float) -> Any:  # noqa: ANN401 - the work's
    """The result of a task, or why there is none."""
    try:
        with _alarm(limit_s):
            return work(task)
    except _LateError:
        return _late(limit_s)
    except (Exception, SystemExit) as error:
        kept = error if isinstance(error, Exception) else None
        return Failure(_one_line(error), error=kept, trace=traceback.format_exc())


def _one_line(error: BaseException) -> str:
    """Kind and message of an error."""
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def _late(limit_s: float) -> Failure:
    return Failure(f"ran past {limit_s:g} s on the clock", late=True)


@contextlib.contextmanager
def _alarm(limit_s: float) -> Iterator[None]:
    """Raise a _LateError in what runs inside once the time is up, where the system has such an alarm."""
    main = threading.current_thread() is threading.main_thread()
    if math.isinf(limit_s) or not main or not hasattr(signal, "setitimer"):
        yield
        return

    def ring(number: int, frame: FrameType | None) -> None:
        del number, frame
        if running:
            raise _LateError

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


class _Worker:
    """A process that does tasks, and the task that it is at."""

    def __init__(self, work: Callable[[Any], Any], limit_s: float) -> None:
        """Start the process."""
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.limit_s = limit_s
        self.process: SpawnProcess = context.Process(target=_serve, args=(theirs, work, limit_s), daemon=True)
        self.process.start()
        theirs.close()

    def give(self, task: Any) -> None:  # noqa: ANN401 - the work's
        """Let it do a task."""
        self.task = task
        self.due = time.monotonic() + self.limit_s + _GRACE_S
        with contextlib.suppress(OSError):  # it has ended: `outcome` will say so
            self.connection.send(task)

    def outcome(self) -> Any:  # noqa: ANN401 - whatever the work returns
        """What came of the task; a process that is late is ended."""
        try:
            if self.connection.poll():
                return self.connection.recv()
        except (EOFError, OSError):
            self.process.join()
            return Failure(_ending(self.process.exitcode))
        self.end()
        return _late(self.limit_s)

    def end(self) -> None:
        """End the process, whatever it is at."""
        self.process.kill()
        self.process.join()
        self.connection.close()


def _ending(code: int | None) -> str:
    """How a process ended, from its exit code."""
    if code is not None and code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended with exit code {code}"


def _serve(connection: Connection, work: Callable[[Any], Any], limit_s: float) -> None:
    """Do tasks until nobody gives any more: what a worker's process runs."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that started this one ends it
    threading.Thread(target=_leave_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            connection.send(_portable(_attempt(work, connection.recv(), limit_s)))


def _leave_with_parent() -> None:
    """End this process, whatever it is at, once the one that started it is gone: killed, for instance."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _portable(outcome: Any) -> Any:  # noqa: ANN401 - whatever the work returns
    """The outcome, without the error where an error cannot be pickled and read again."""
    if isinstance(outcome, Failure):
        try:
            pickle.loads(pickle.dumps(outcome.error))
        except Exception:
            return dataclasses.replace(outcome, error=None)
    return outcome


def _run_in_processes(
    work: Callable[[Any], Any], tasks: Sequence[Task], jobs: int, limit_s: float
) -> Generator[tuple[Task, Any], None, None]:
    """Yield every task with its outcome as they come; a process that ends is replaced."""
    queue = deque(tasks)
    busy: list[_Worker] = []
    try:
        for _ in range(jobs):
            busy.append(_Worker(work, limit_s))
            busy[-1].give(queue.popleft())
        while busy:
            due_s = min(worker.due for worker in busy) - time.monotonic()
            timeout = None if math.isinf(due_s) else max(due_s, 0.0)
            ready = set(wait([worker.connection for worker in busy], timeout))
            for worker in list(busy):
                if worker.connection not in ready and time.monotonic() < worker.due:
                    continue
                task, outcome = worker.task, worker.outcome()
                busy.remove(worker)
                alive = worker.process.is_alive()
                if not (queue and alive):
                    worker.end()
                if queue:
                    busy.append(worker if alive else _Worker(work, limit_s))
                    busy[-1].give(queue.popleft())
                yield task, outcome
    finally:
        for worker in busy:
            worker.end()
