"""A second process that compiles what this one needs next, so that a cold start uses two processors.

Both are given the same kernels. This one goes through the kernels that each of them calls from the first to
the last, the helper from the last to the first; what one has compiled the other finds on disk, and they meet
in the middle. A kernel that Python calls is translated as a whole, which cannot be shared, so both compile
what all kernels asked for call before either translates one. The helper starts only when a step's kernels
are not on disk. It is ended with this process, and ends when it has had nothing to do for a while.
"""

from __future__ import annotations

import atexit
import importlib
import multiprocessing
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from entropy_explore_env.compilation.folder import fcntl, kernel_folder
from entropy_explore_env.compilation.numba_parts import config, dumps

_IDLE_S = 30
_CODE = """
import sys
from types import ModuleType

package = sys.modules["{name}"] = ModuleType("{name}")
package.__path__ = {path}
from {name}.compilation.second_process import serve

serve()
"""
"""What a helper runs: kernels need their own modules, not the environments that the package imports."""


_Request = tuple[Any, tuple[Any, ...]]
"""A kernel, and the types of Numba that it is called with."""


class _Helper:
    """The helper of this process, as far as there is one, or this process as a helper."""

    process: subprocess.Popen[bytes] | None = None
    requests: Connection | None = None
    """Where a helper reads what it is asked for; None = this process is not a helper."""

    def __init__(self) -> None:
        """Start nothing yet."""
        self.lock = threading.Lock()
        """Held while a helper is asked, so that threads start one helper alone."""
        self.asked: list[_Request] = []
        self.waiting: deque[_Request] = deque()
        """Those of which this process has not begun to compile what they call."""
        self.unsent: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        """What the helper has not been sent yet; None = there is no more."""

    def runs(self) -> bool:
        """Whether a helper is at work."""
        return self.process is not None and self.process.poll() is None


_helper = _Helper()


def serves() -> bool:
    """Whether this process is a helper."""
    return _helper.requests is not None


def shared() -> bool:
    """Whether another process compiles the same kernels as this one."""
    return serves() or _helper.runs()


def send(kernels: Iterable[_Request], *, start: bool = False) -> None:
    """Let the helper compile kernels.

    Args:
        kernels: Each with the types of its arguments.
        start: Whether to start a helper if there is none.
    """
    with _helper.lock:
        if start and not _helper.runs() and _is_wanted():
            _start()
        if not _helper.runs():
            return
        for kernel, types in kernels:
            if (kernel, types) not in _helper.asked:
                _helper.asked.append((kernel, types))
                _helper.waiting.append((kernel, types))
                name = kernel.py_func.__module__, kernel.py_func.__qualname__
                _helper.unsent.put(dumps((*name, types)))


def not_begun() -> Iterator[_Request]:
    """Yield kernels asked for, also while more are asked for; each process begins each of them once."""
    while _helper.waiting or _receive(wait_s=0):
        yield _helper.waiting.popleft()


def _is_wanted() -> bool:
    """Whether a second process has a processor to run on, and can tell this one what it compiled."""
    main = multiprocessing.parent_process() is None and not serves()
    return main and fcntl is not None and kernel_folder() is not None and _processors() > 1


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _start() -> None:
    """Start a helper that finds modules where this process does, and keeps kernels there."""
    modules = os.pathsep.join(path or str(Path.cwd()) for path in sys.path)
    folder = str(getattr(config, "CACHE_DIR", ""))
    package = sys.modules[__name__.partition(".")[0]]
    with suppress(OSError):
        _helper.process = subprocess.Popen(
            [sys.executable, "-c", _CODE.format(name=package.__name__, path=list(package.__path__))],
            env={**os.environ, "PYTHONPATH": modules, "NUMBA_CACHE_DIR": folder},
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        atexit.register(_helper.process.kill)
        _helper.unsent.put(None)  # to a helper before, which has ended
        _helper.asked, _helper.unsent = [], queue.SimpleQueue()
        given = _helper.process, _helper.unsent
        threading.Thread(target=_write_requests, args=given, daemon=True).start()


def _write_requests(process: subprocess.Popen[bytes], unsent: queue.SimpleQueue[bytes | None]) -> None:
    """Write what a helper is asked for: a pipe holds few requests, and the helper reads between kernels."""
    assert process.stdin is not None
    with suppress(OSError), Connection(os.dup(process.stdin.fileno()), readable=False) as requests:
        while (request := unsent.get()) is not None:
            requests.send_bytes(request)


def _receive(wait_s: float) -> bool:
    """Return whether a helper was asked for one more kernel, of those that it can find."""
    while _helper.requests is not None:
        try:
            if not _helper.requests.poll(wait_s):
                return False
            request = _helper.requests.recv_bytes()
        except (EOFError, OSError):  # the other process has ended
            return False
        with suppress(Exception):  # a kernel of a script or a function, or one that needs the environments
            module, name, types = pickle.loads(request)
            found = getattr(importlib.import_module(module), name), types
            _helper.asked.append(found)
            _helper.waiting.append(found)
            return True
    return False


def serve() -> None:
    """Compile what standard input asks for, until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _helper.requests, done = Connection(sys.stdin.fileno(), writable=False), 0
    while done < len(_helper.asked) or _receive(wait_s=_IDLE_S):
        kernel, types = _helper.asked[done]
        done += 1
        with suppress(Exception):  # the process that asked for it meets the same and says so
            kernel.compile(types)
