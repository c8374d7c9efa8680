"""Which process compiles a kernel, where several need it at once: the others wait for it.

A claim is a lock on a file beside the kernel's own. The system lets go of it when its process ends. Where
there are no such locks, each process compiles for itself.
"""

from __future__ import annotations

import time
from pathlib import Path
from types import ModuleType
from typing import IO

from entropy_explore_env.compilation.folder import CLAIM

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None

_PATIENCE_S = 60.0
"""A process that was stopped holds others up no longer than this: no kernel takes half as long."""
_PAUSE_S = 0.01


class Claim:
    """The right to compile one kernel; `release` ends it."""

    def __init__(self, path: Path, held: IO[bytes] | None) -> None:
        """Note the claim's file; None = others may be compiling the same."""
        self._path, self._held = path, held

    def release(self) -> None:
        """Let others have it; what they find now is the kernel on disk."""
        if self._held is not None:
            self._path.unlink(missing_ok=True)
            self._held.close()
            self._held = None


def claim(kernel: Path) -> Claim:
    """Wait until no other process compiles a kernel, given by its file, and claim it.

    Returns:
        The claim; without effect where the folder cannot be written, or others keep it for too long.
    """
    path = kernel.with_suffix(CLAIM)
    if fcntl is None:
        return Claim(path, None)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        held = path.open("wb")
    except OSError:
        return Claim(path, None)
    until_s = time.monotonic() + _PATIENCE_S
    while time.monotonic() < until_s:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return Claim(path, held)
        except BlockingIOError:
            time.sleep(_PAUSE_S)
        except OSError:  # of a file system without locks
            break
    held.close()
    return Claim(path, None)
