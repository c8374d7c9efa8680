"""Tasks on a Ray cluster: every one is a Ray task with its time limit, begun again where a worker is lost.

In place of worker_pool's processes, with the same results. A task whose process or machine ends is begun
again elsewhere, up to ATTEMPTS times; what a task raises is its Failure at once.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

import contextlib
import math
import os
import pickle
import sys
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from baselines.experiments.ray_cluster import LOCAL, RayCluster, join, ray_of, start_here
from baselines.experiments.worker_pool import Failure, attempt_packed, failure_of, late

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 5
"""How often a task is begun whose worker is lost: more losses than these are likely its own doing."""
GRACE_S = 5.0
"""A task past its limit that does not end at its worker's alarm is ended, with the worker, so much later."""
_WAITING = 2
"""Tasks handed to the cluster for each of its processors: who ends one finds the next, and autoscalers see
that more is wanted."""
_LOOK_EVERY_S = 0.5
"""Late tasks are looked for, and processors counted, so often."""


@dataclass(frozen=True)
class _Attempt:
    """One attempt at a task.

    Attributes:
        place: Which task.
        number: Which attempt, from 1.
        begun_s: When a worker took it up, on this process's clock; None = it waits.
    """

    place: int
    number: int
    begun_s: float | None = None


def run_on_cluster(
    work: Callable[[Task], Result], tasks: Sequence[Task], cluster: RayCluster, limit_s: float
) -> Generator[tuple[Task, Result | Failure], None, None]:
    """Do the work for every task on the cluster, and yield results as they come.

    Joins the cluster, or starts it, unless this process has done so already, and leaves it then.

    Args:
        work: A function at the top of a module that every machine of the cluster can import.
        tasks: What it takes; they and the results can be pickled.
        cluster: Where.
        limit_s: Of every task, on the clock from when it is begun; inf = none.

    Raises:
        MissingExtraError: Ray is not installed.
        SettingError: No cluster answers at the address.
        EntropyExploreError: Ray does not start.
    """
    if not tasks:
        return
    ray = ray_of("cluster")
    started = not ray.is_initialized()
    if started and cluster.address == LOCAL:
        start_here(ray, cluster.at_once or os.cpu_count() or 1)
    elif started:
        join(ray, "cluster", cluster.address)
    try:
        # Ray tells of lost workers on standard output, which is for results.
        with contextlib.redirect_stdout(sys.stderr):
            yield from _Sweep(ray, work, tasks, cluster, limit_s).results()
    finally:
        if started:
            ray.shutdown()


class _Sweep:
    """The tasks of one call: which of them wait, and which are on the cluster."""

    def __init__(
        self,
        ray: Any,  # noqa: ANN401 - the module
        work: Callable[[Any], Any],
        tasks: Sequence[Any],
        cluster: RayCluster,
        limit_s: float,
    ) -> None:
        self._ray, self._work, self._tasks = ray, work, tasks
        self._at_once, self._limit_s = cluster.at_once, limit_s
        self._remote = ray.remote(_begun_and_done).options(
            num_cpus=1, max_retries=0, num_returns="streaming", name=getattr(work, "__qualname__", "work")
        )
        self._waiting = deque(_Attempt(place, 1) for place in range(len(tasks)))
        self._running: dict[Any, _Attempt] = {}
        self._room, self._counted_s = 1, -math.inf

    def results(self) -> Iterator[tuple[Any, Any]]:
        """Task and result, or Failure, of each as it comes."""
        try:
            while self._waiting or self._running:
                self._count_processors()
                failed = [self._hand_over() for _ in range(self._room - len(self._running)) if self._waiting]
                found = [*failed, *self._late(), *self._heard()]
                yield from ((self._tasks[attempt.place], end) for attempt, end in filter(None, found))
        finally:
            for answers in self._running:
                self._end(answers)

    def _count_processors(self) -> None:
        """How many tasks the cluster is given: it may grow and shrink."""
        if self._at_once is not None:
            self._room = self._at_once
        elif time.monotonic() - self._counted_s > _LOOK_EVERY_S:
            self._room = max(1, _WAITING * int(self._ray.cluster_resources().get("CPU", 1)))
            self._counted_s = time.monotonic()

    def _hand_over(self) -> tuple[_Attempt, Failure] | None:
        """Give the cluster the next task; a Failure if it cannot be pickled."""
        attempt = self._waiting.popleft()
        try:
            # Of the command itself, `__main__`, workers have nothing: cloudpickle sends its functions whole.
            packed = self._ray.cloudpickle.dumps((self._work, self._tasks[attempt.place]))
        except Exception as error:
            return attempt, failure_of(error)
        self._running[self._remote.remote(packed, self._limit_s)] = attempt
        return None

    def _late(self) -> Iterator[tuple[_Attempt, Failure]]:
        """End what is far beyond its limit."""
        if math.isinf(self._limit_s):
            return
        latest_s = time.monotonic() - self._limit_s - GRACE_S
        for answers, attempt in list(self._running.items()):
            if attempt.begun_s is not None and attempt.begun_s < latest_s:
                del self._running[answers]
                self._end(answers)
                yield attempt, late(self._limit_s)

    def _heard(self) -> Iterator[tuple[_Attempt, Any]]:
        """Wait for the next answer of a worker, for a moment."""
        if not self._running:
            return
        ready, _ = self._ray.wait(list(self._running), num_returns=1, timeout=_LOOK_EVERY_S)
        for answers in ready:
            attempt = self._running[answers]
            try:
                said = self._ray.get(next(answers))
            except self._ray.exceptions.RayTaskError as error:  # before the work: it cannot be imported, say
                said = pickle.dumps(failure_of(error.cause or error))
            except self._ray.exceptions.RayError as error:
                del self._running[answers]
                if attempt.number < ATTEMPTS:
                    self._waiting.appendleft(_Attempt(attempt.place, attempt.number + 1))
                else:
                    reason = f"its worker was lost {ATTEMPTS} times: {type(error).__name__}"
                    yield attempt, Failure(reason)
                continue
            if said is None:
                self._running[answers] = replace(attempt, begun_s=time.monotonic())
            else:
                del self._running[answers]
                yield attempt, _read(said)

    def _end(self, answers: Any) -> None:  # noqa: ANN401 - Ray's ObjectRefGenerator
        """End a task, together with its worker."""
        with contextlib.suppress(Exception):
            self._ray.cancel(answers, force=True)


def _read(said: bytes) -> Any:  # noqa: ANN401 - whatever the work returns
    """A result, or a Failure where it cannot be read."""
    try:
        return pickle.loads(said)
    except Exception as error:
        return failure_of(error)


def _begun_and_done(packed: bytes, limit_s: float) -> Iterator[bytes | None]:
    """On a worker: None when a task is taken up, then its result or Failure, pickled."""
    work, task = pickle.loads(packed)  # imports what the task needs, which its limit does not count
    yield None
    yield attempt_packed(work, task, limit_s)
