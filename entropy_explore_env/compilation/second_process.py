"""A second process that compiles what this one needs next, so that a cold start uses two processors.

Both are given the same kernels. This one goes through the kernels that each of them calls from the first to
the last, the helper from the last to the first; what one has compiled the other finds on disk, and they meet
in the middle. A kernel that Python calls is translated as a whole, which cannot be shared, so both compile
what all kernels asked for call before either translates one. The helper starts only when a step's kernels
are not on disk. It ends with this process, or when it has had nothing to do for a while.
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
    """Where a helper reads what it is asked for; None = this process is none."""

    def __init__(self) -> None:
        """Start nothing yet."""
        self.asked: list[_Request] = []
        self.begun = 0
        """Number of requests for which what they call has been compiled, or is being compiled."""
        self.unsent: queue.SimpleQueue[bytes] = queue.SimpleQueue()

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
    if start and not _helper.runs() and _is_wanted():
        _start()
    if not _helper.runs():
        return
    for kernel, types in kernels:
        if (kernel, types) not in _helper.asked:
            _helper.asked.append((kernel, types))
            _helper.unsent.put(dumps((kernel.py_func.__module__, kernel.py_func.__qualname__, types)))


def not_begun() -> Iterator[_Request]:
    """Yield kernels asked for, also while more are asked for; each process begins each of them once."""
    while _helper.begun < len(_helper.asked) or _receive(wait_s=0):
        _helper.begun += 1
        yield _helper.asked[_helper.begun - 1]


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
        threading.Thread(target=_write_requests, args=(_helper.process,), daemon=True).start()


def _write_requests(process: subprocess.Popen[bytes]) -> None:
    """Write what a helper is asked for: a pipe holds few requests, and the helper reads between kernels."""
    assert process.stdin is not None
    with suppress(OSError), Connection(os.dup(process.stdin.fileno()), readable=False) as requests:
        while True:  # until it has ended
            requests.send_bytes(_helper.unsent.get())


def _receive(wait_s: float) -> bool:
    """Return whether a helper was asked for one more kernel."""
    try:
        if _helper.requests is None or not _helper.requests.poll(wait_s):
            return False
        module, name, types = pickle.loads(_helper.requests.recv_bytes())
        _helper.asked.append((getattr(importlib.import_module(module), name), types))
    except (EOFError, OSError):  # the other process has ended
        return False
    return True


def serve() -> None:
    """Compile what standard input asks for, until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _helper.requests, done = Connection(sys.stdin.fileno(), writable=False), 0
    while done < len(_helper.asked) or _receive(wait_s=_IDLE_S):
        kernel, types = _helper.asked[done]
        done += 1
        with suppress(Exception):  # the process that asked for it meets the same and says so
            kernel.compile(types)
