"""The threads that share missions; a process that was forked begins its own."""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor


class Threads:
    """Threads that are begun by the first call, and end with `close` or with this object.

    A fork copies the memory of a process but none of its threads: whoever waited for them in the child would
    wait for ever. So a child forgets them, and begins others when it needs them.
    """

    def __init__(self, count: int) -> None:
        """Keep the number of threads; none is started yet."""
        self._count = count
        self._pool: ThreadPoolExecutor | None = None
        _ALL.add(self)

    def run(self, work: Callable[[int], None]) -> None:
        """Call `work(number)` in every thread, and wait for all; raises what the first of them raised."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self._count, "missions")
        for done in [self._pool.submit(work, number) for number in range(self._count)]:
            done.result()

    def close(self) -> None:
        """End the threads; the next call begins others."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def forget(self) -> None:
        """Drop the threads without waiting for them: this process has none."""
        self._pool = None


_ALL: weakref.WeakSet[Threads] = weakref.WeakSet()


def _forget_all() -> None:
    for threads in list(_ALL):
        threads.forget()


if hasattr(os, "register_at_fork"):  # not on Windows, which cannot fork
    os.register_at_fork(after_in_child=_forget_all)
