"""A second process that compiles what this one needs next, so that a cold start uses two processors.

Both are given the same kernels. This one goes through the kernels that each of them calls from the first to
the last, the helper from the last to the first; what one has compiled the other finds on disk, and they meet
in the middle. The helper starts only when a step's kernels are not on disk. It ends with this process,
or when it has had nothing to do for a while.
"""

from __future__ import annotations

import atexit
import importlib
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from entropy_explore_env.compilation.folder import fcntl, kernel_folder
from entropy_explore_env.compilation.numba_parts import config, dumps

_IDLE_S = 30
_CODE = "from entropy_explore_env.compilation.second_process import serve; serve()"


class _Helper:
    """The helper of this process, as far as there is one."""

    process: subprocess.Popen[bytes] | None = None
    serving = False

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
    process = _helper.process
    if process is None or process.stdin is None or not _helper.runs():
        return
    with suppress(OSError, ValueError):  # it has ended
        for kernel, types in kernels:
            function = kernel.py_func
            process.stdin.write(dumps((function.__module__, function.__qualname__, types)))
        process.stdin.flush()


def _is_wanted() -> bool:
    """Whether a second process has a processor to run on, and can tell this one what it compiled."""
    main = multiprocessing.parent_process() is None and not _helper.serving
    return main and fcntl is not None and kernel_folder() is not None and _processors() > 1


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _start() -> None:
    """Start a helper that finds modules where this process does, and keeps kernels there."""
    modules = os.pathsep.join(path or str(Path.cwd()) for path in sys.path)
    folder = str(getattr(config, "CACHE_DIR", ""))
    with suppress(OSError):
        _helper.process = subprocess.Popen(
            [sys.executable, "-c", _CODE],
            env={**os.environ, "PYTHONPATH": modules, "NUMBA_CACHE_DIR": folder},
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        atexit.register(_helper.process.kill)


def serve() -> None:
    """Compile what standard input asks for, until it ends."""
    _helper.serving = True
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        signal.alarm(_IDLE_S)  # which ends the process
        try:
            module, name, types = pickle.load(sys.stdin.buffer)
        except Exception:  # the other process has ended
            return
        signal.alarm(0)
        with suppress(Exception):  # the process that asked for it meets the same and says so
            getattr(importlib.import_module(module), name).compile(types)
