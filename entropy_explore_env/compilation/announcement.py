"""What compiling says: one line when it begins, one when it is done.

They are warnings of the logger `entropy_explore_env`, which Python prints on standard error unless a
program says otherwise: `logging.getLogger("entropy_explore_env").setLevel(logging.ERROR)` makes them silent.
Processes that `multiprocessing` started are silent.
"""

from __future__ import annotations

import logging
import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_LOGGER = logging.getLogger("entropy_explore_env")


class _Progress:
    """What this process has compiled, and said of it."""

    def __init__(self) -> None:
        self.compiled: list[str] = []
        self.spent_s = 0.0
        self.pending = False
        self.announced = False
        self.said_why_not_kept = False


_progress = _Progress()


def compiled_kernels() -> tuple[str, ...]:
    """Return the kernels that this process has compiled for Python, once for each combination of types."""
    return tuple(_progress.compiled)


def compiling_s() -> float:
    """Return the seconds that this process has spent on compiling so far."""
    return _progress.spent_s


@contextmanager
def compiling(name: str, folder: Path | None) -> Iterator[None]:
    """Note a kernel that Python calls while it is compiled; the first one is announced."""
    _progress.compiled.append(name)
    if not _progress.announced:
        _progress.announced = _progress.pending = True
        kept = "" if folder is None else f"; they are kept in {short_path(folder)}"
        _say(f"entropy_explore_env: compiling kernels, up to a minute{kept}")
    began_s = time.perf_counter()
    try:
        yield
    finally:
        _progress.spent_s += time.perf_counter() - began_s


def end_of_step() -> None:
    """Say what was compiled, now that a mission has advanced."""
    if _progress.pending:
        _progress.pending = False
        number = len(_progress.compiled)
        kernels = "1 kernel" if number == 1 else f"{number} kernels"
        _say(f"entropy_explore_env: compiled {kernels} in {_progress.spent_s:.0f} s")


def explain_not_kept(folder: Path | None, error: OSError | None) -> None:
    """Say once that compiled code cannot be written."""
    if _progress.said_why_not_kept:
        return
    _progress.said_why_not_kept = True
    reason = "" if error is None else error.strerror or str(error)
    where = "the user has no home folder" if folder is None else f"{short_path(folder)}: {reason}"
    _say(
        f"entropy_explore_env: compiled kernels are not kept ({where}), each process compiles them anew; "
        "set NUMBA_CACHE_DIR to a folder that can be written"
    )


def explain_no_stamp(reason: str) -> None:
    """Log why a kernel is compiled in each process."""
    _LOGGER.getChild("compilation").info("compiled kernel is not kept: %s", reason)


def _say(line: str) -> None:
    if multiprocessing.parent_process() is None:
        _LOGGER.warning(line)


def short_path(folder: Path) -> str:
    """Return a path that begins with ~ where it lies in the home folder."""
    try:
        return f"~/{folder.relative_to(Path.home()).as_posix()}"
    except (ValueError, RuntimeError):
        return str(folder)
