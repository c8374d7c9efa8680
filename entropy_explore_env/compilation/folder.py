"""Where compiled kernels are kept, and how long."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from entropy_explore_env.compilation.numba_parts import config

FOLDER = "entropy_explore_env"
SUFFIX = ".kernel"
CLAIM = ".claim"
"""Of the files that processes lock while they compile a kernel."""
MAX_DAYS = 90.0
"""Kernels that no process has used for as long are removed."""
MAX_BYTES = 1 << 30
"""With more, those which were used longest ago are removed, until half of it is left."""

_DAY_S = 86400.0
_PARTIAL = ".part"


def kernel_folder() -> Path | None:
    """Return the folder of compiled kernels: in `NUMBA_CACHE_DIR`, or else in the user's cache folder.

    Returns:
        None where the system names no folder for the user.
    """
    named = getattr(config, "CACHE_DIR", "")  # Numba sets its settings by name
    if named:
        return Path(named) / FOLDER
    try:
        home = Path.home()
    except RuntimeError:
        home = None
    found = user_cache_folder(sys.platform, os.environ, home)
    return None if found is None else found / FOLDER / "kernels"


def user_cache_folder(platform: str, environment: Mapping[str, str], home: Path | None) -> Path | None:
    """Where programs keep what they can make again: the convention of each system.

    Args:
        platform: As `sys.platform`.
        environment: As `os.environ`.
        home: The user's folder; None = not known.
    """
    if platform == "win32":
        local = environment.get("LOCALAPPDATA")
        if local:
            return Path(local)
        return None if home is None else home / "AppData" / "Local"
    if platform == "darwin":
        return None if home is None else home / "Library" / "Caches"
    named = environment.get("XDG_CACHE_HOME", "")
    if Path(named).is_absolute():  # the convention wants others to be ignored
        return Path(named)
    return None if home is None else home / ".cache"


def partial_name(path: Path) -> Path:
    """Return a name that no other process takes, for a file that is being written."""
    return path.with_name(f"{path.name}.{os.getpid()}-{time.monotonic_ns():x}{_PARTIAL}")


def mark_used(path: Path) -> None:
    """Note that a kernel is in use, once a day."""
    try:
        if time.time() - path.stat().st_mtime > _DAY_S:
            os.utime(path)
    except OSError:  # it belongs to someone else, or has just been removed
        pass


def remove_old_kernels(folder: Path, max_bytes: int = MAX_BYTES) -> None:
    """Remove what has not been used for long, and the oldest where there is too much.

    Other processes may be doing the same. A process that misses a kernel compiles it.
    """
    now = time.time()
    kept: list[tuple[float, int, Path]] = []
    for entry in _entries(folder):
        try:
            status = entry.stat()
        except OSError:
            continue
        age_s = now - status.st_mtime
        if age_s > (MAX_DAYS * _DAY_S if entry.suffix == SUFFIX else _DAY_S):
            _remove(entry)
        elif entry.suffix == SUFFIX:
            kept.append((status.st_mtime, status.st_size, entry))
    total = sum(size for _, size, _ in kept)
    if total <= max_bytes:
        return
    for _, size, path in sorted(kept):
        _remove(path)
        total -= size
        if total <= max_bytes // 2:
            return


def _entries(folder: Path) -> list[Path]:
    try:
        return [entry for entry in folder.iterdir() if entry.suffix in (SUFFIX, CLAIM, _PARTIAL)]
    except OSError:
        return []


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError:  # Windows does not remove what another process reads
        pass
