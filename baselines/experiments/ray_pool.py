"""Tasks on a Ray cluster, by its own pool of workers: one whose worker or machine ends is begun again."""
# pyright: reportMissingImports=false

from __future__ import annotations

import contextlib
import os
import pickle
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any, TypeVar

from baselines.experiments.ray_cluster import LOCAL, RayCluster, join, ray_of, start_here
from baselines.experiments.worker_pool import Failure, attempt_packed, failure_of

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 5
"""How often a task is begun whose worker is lost: more losses than these are likely its own doing."""
_WAITING = 2
"""Tasks handed to the cluster for each of its processors, so that autoscalers see that more is wanted."""
_LOOK_EVERY_S = 0.5
"""Processors are counted this often: a cluster may grow."""


def run_on_cluster(
    work: Callable[[Task], Result], tasks: Sequence[Task], cluster: RayCluster, limit_s: float
) -> Generator[tuple[Task, Result | Failure], None, None]:
    """Do the work for every task on the cluster, and yield results as they come.

    Joins the cluster, or starts it, unless this process has done so already, and leaves it then. Every
    machine of it can import the work. See `worker_pool.run_each`.

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
            yield from _results(ray, work, tasks, cluster.at_once, limit_s)
    finally:
        if started:
            ray.shutdown()


def _results(
    ray: Any,  # noqa: ANN401 - the module
    work: Callable[[Any], Any],
    tasks: Sequence[Any],
    at_once: int | None,
    limit_s: float,
) -> Iterator[tuple[Any, Any]]:
    """Yield task and result, or Failure, of each as it comes."""
    attempt = ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1, name="trial")(_attempt)
    waiting, running = deque(tasks), dict[Any, Any]()
    try:
        while waiting or running:
            room = at_once or _WAITING * int(ray.cluster_resources().get("CPU", 1))
            while waiting and len(running) < room:
                task = waiting.popleft()
                try:
                    # Workers have nothing of the command itself, `__main__`: cloudpickle sends it.
                    running[attempt.remote(ray.cloudpickle.dumps((work, task)), limit_s)] = task
                except Exception as error:
                    yield task, failure_of(error)
            ready, _ = ray.wait(list(running), num_returns=1, timeout=_LOOK_EVERY_S)
            for each in ready:
                yield running.pop(each), _result(ray, each)
    finally:
        for each in running:
            ray.cancel(each, force=True)


def _result(ray: Any, reference: Any) -> Any:  # noqa: ANN401 - whatever the work returns
    """Return what a task came to; a Failure where it has no result."""
    try:
        return pickle.loads(ray.get(reference))
    except ray.exceptions.RayTaskError as error:  # before the work: it cannot be imported there, say
        return failure_of(error.cause or error)
    except ray.exceptions.RayError as error:
        return Failure(f"its worker was lost {ATTEMPTS} times: {type(error).__name__}")
    except Exception as error:
        return failure_of(error)


def _attempt(packed: bytes, limit_s: float) -> bytes:
    """Do the work in a worker, and return its result or Failure, pickled."""
    work, task = pickle.loads(packed)
    return attempt_packed(work, task, limit_s)
