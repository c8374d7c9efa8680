"""A second process that compiles what this one needs next, so that a cold start uses two processors.

Both are given the same kernels. This one goes through the kernels that each of them calls from the first to
the last, the helper from the last to the first; what one has compiled the other finds on disk, and they meet
in the middle. The helper starts when a step's kernels are not on disk, never else. It ends with this process,
or when it has had nothing to do for a while.
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
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

from entropy_explore_env.compilation import locks
from entropy_explore_env.compilation.folder import kernel_folder
from entropy_explore_env.compilation.numba_parts import config, dumps

_IDLE_S = 30.0
_CODE = "from entropy_explore_env.compilation.second_process import serve; serve()"


class _Helper:
    """The helper of this process, as far as there is one."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None
        self.serving = False

    def runs(self) -> bool:
        """Whether a helper is at work."""
        return self.process is not None and self.process.poll() is None


_helper = _Helper()


def serves() -> bool:
    """Whether this process is a helper."""
    return _helper.serving


def shared() -> bool:
    """Whether another process compiles the same kernels as this one."""
    return _helper.serving or _helper.runs()


def send(kernels: Iterable[tuple[Any, tuple[Any, ...]]], *, start: bool = False) -> None:
    """Let the helper compile kernels, each for the types of its arguments.

    Args:
        kernels: (kernel, types of Numba) each.
        start: Whether to start a helper if there is none.
    """
    if start and not _helper.runs() and _is_wanted():
        _start()
    if _helper.runs():
        for kernel, types in kernels:
            function = kernel.py_func
            _tell((function.__module__, function.__qualname__, types))


def _is_wanted() -> bool:
    """Whether a second process has a processor to run on, and can tell this one what it compiled."""
    main = multiprocessing.parent_process() is None and not _helper.serving
    return main and locks.fcntl is not None and kernel_folder() is not None and _processors() > 1


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _start() -> None:
    try:
        _helper.process = subprocess.Popen(
            [sys.executable, "-c", _CODE],
            env=_environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        return
    atexit.register(_stop, _helper.process)


def _environment() -> dict[str, str]:
    """Return the variables of this process, where it finds its modules and where it keeps kernels."""
    modules = os.pathsep.join(path or str(Path.cwd()) for path in sys.path)
    folder = getattr(config, "CACHE_DIR", "")
    return {**os.environ, "PYTHONPATH": modules, **({"NUMBA_CACHE_DIR": str(folder)} if folder else {})}


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.communicate()


def _tell(request: tuple[str, str, tuple[Any, ...]]) -> None:
    assert _helper.process is not None and _helper.process.stdin is not None
    try:
        _helper.process.stdin.write(dumps(request))
        _helper.process.stdin.flush()
    except (OSError, ValueError):  # it has ended
        _helper.process.kill()


def serve() -> None:
    """Compile what standard input asks for, until it ends."""
    _helper.serving = True
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    requests: queue.SimpleQueue[tuple[str, str, Any]] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin.buffer, requests), daemon=True).start()
    while True:
        try:
            module, name, types = requests.get(timeout=_IDLE_S)
        except queue.Empty:
            return
        try:
            getattr(importlib.import_module(module), name).compile(types)
        except Exception:  # the process that asked for it meets the same and says so
            continue


def _read(stream: IO[bytes], requests: queue.SimpleQueue[tuple[str, str, Any]]) -> None:
    """Take requests; the process ends with the one that makes them."""
    while True:
        try:
            requests.put(pickle.load(stream))
        except Exception:
            os._exit(0)
