"""Where compiled kernels are kept, how long, and which process compiles one that several need at once."""

from __future__ import annotations

import os
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from types import ModuleType
from typing import IO

import platformdirs

from entropy_explore_env.compilation.numba_parts import config

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None

FOLDER = "entropy_explore_env"
SUFFIX, _CLAIM, _PARTIAL = ".kernel", ".claim", ".part"
"""Of kernels, of files that processes lock while they compile one, and of files that are being written."""
MAX_DAYS = 90.0
"""Kernels that no process has used for as long are removed."""
MAX_BYTES = 1 << 30
"""With more, those which were used longest ago are removed, until half of it is left."""

_DAY_S = 86400.0
_PATIENCE_S = 60.0
"""A process that was stopped holds others up no longer than this: no kernel takes half as long."""
_PAUSE_S = 0.01


def kernel_folder() -> Path | None:
    """Return the folder of compiled kernels: in `NUMBA_CACHE_DIR`, or else in the user's cache folder.

    Returns:
        None where the system names no folder for the user.
    """
    named = getattr(config, "CACHE_DIR", "")  # Numba sets its settings by name
    if named:
        return Path(named) / FOLDER
    found = Path(platformdirs.user_cache_dir(FOLDER, appauthor=False)) / "kernels"
    return found if found.is_absolute() else None


class ClaimedError(Exception):
    """Another process compiles the kernel."""


def claim(kernel: Path, *, waits: bool = True) -> IO[bytes] | None:
    """Claim a kernel, given by its file, once no other process compiles it.

    A claim is a lock on a file beside the kernel's own. The system lets go of it when its process ends.

    Returns:
        What `release` takes; None where there are no such locks, where the folder cannot be written, or where
        others keep the claim for too long.

    Raises:
        ClaimedError: Another process has claimed it, and this one is not to wait.
    """
    if fcntl is None:
        return None
    until_s = time.monotonic() + _PATIENCE_S
    with suppress(OSError), ExitStack() as opened:
        kernel.parent.mkdir(parents=True, exist_ok=True)
        held = opened.enter_context(kernel.with_suffix(_CLAIM).open("wb"))
        while time.monotonic() < until_s:
            try:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
                opened.pop_all()  # it stays open
                return held
            except BlockingIOError:
                if not waits:
                    raise ClaimedError from None
                time.sleep(_PAUSE_S)
    return None


def release(held: IO[bytes] | None) -> None:
    """Let others have a claim; what they find now is the kernel on disk."""
    if held is not None:
        Path(held.name).unlink(missing_ok=True)
        held.close()


def write_whole(path: Path, data: bytes) -> None:
    """Write a file as a whole or not at all."""
    part = path.with_name(f"{path.name}.{os.getpid()}-{time.monotonic_ns():x}{_PARTIAL}")
    try:
        part.write_bytes(data)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def mark_used(path: Path) -> None:
    """Note that a kernel is in use, once a day."""
    with suppress(OSError):  # it belongs to someone else, or has just been removed
        if time.time() - path.stat().st_mtime > _DAY_S:
            os.utime(path)


def remove_old_kernels(folder: Path, max_bytes: int = MAX_BYTES) -> None:
    """Remove what has not been used for long, and the oldest where there is too much.

    Other processes may be doing the same. A process that misses a kernel compiles it.
    """
    now, kept = time.time(), []
    for suffix, days in ((SUFFIX, MAX_DAYS), (_CLAIM, 1.0), (_PARTIAL, 1.0)):
        for path in folder.glob(f"*{suffix}"):
            with suppress(OSError):  # another process was faster; or, on Windows, reads it
                status = path.stat()
                if now - status.st_mtime > days * _DAY_S:
                    path.unlink()
                elif suffix == SUFFIX:
                    kept.append((status.st_mtime, status.st_size, path))
    total = sum(size for _, size, _ in kept)
    if total <= max_bytes:
        return
    for _, size, path in sorted(kept):
        if total > max_bytes // 2:
            with suppress(OSError):
                path.unlink()
            total -= size
