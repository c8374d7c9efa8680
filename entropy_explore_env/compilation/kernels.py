"""How kernels are compiled, and when compiled code on disk is forgotten.

Numba compiles a kernel anew when its own file changes, but not when a kernel that it calls changes in
another file: after an update, or an edit, old and new code would mix without a word. And two processes that
compile a kernel for different types at the same time may give both the same file: here every file has a name
of its own.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
_LEAN_OPTIONS: dict[str, Any] = {**_OPTIONS, "_nrt": False}


def _compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:  # noqa: ANN401 - a dispatcher, or the function
    """`njit` whose code on disk no other process writes over."""

    def decorate(function: Callable[..., Any]) -> Any:  # noqa: ANN401
        dispatcher = njit(**options)(function)
        files = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
        if files is not None:
            numbered = files._data_name
            files._data_name = lambda number: f"{secrets.token_hex(4)}.{numbered(number)}"
        return dispatcher

    return decorate


kernel = _compiled(**_OPTIONS)
"""Compiled once and kept on disk; other threads run meanwhile; a division by zero gives inf or nan."""
lean_kernel = _compiled(**_LEAN_OPTIONS)
"""A kernel that makes no array and so counts no references: each row that it slices would cost a count.

Numba refuses to compile one that does make an array.
"""
inlined_kernel = _compiled(**_LEAN_OPTIONS, forceinline=True)
"""A lean kernel for what happens once a ray: it becomes part of each kernel that calls it."""


def forget_stale_kernels(folder: Path, *others: Path) -> None:
    """Drop the compiled kernels of a package if its sources, or those that it builds on, changed.

    Concerns the caches beside the sources. Where `NUMBA_CACHE_DIR` puts them elsewhere, or the folder
    cannot be written, nothing is done.

    Args:
        folder: The package; called before its kernels are imported.
        others: Packages whose kernels it calls.
    """
    hasher = hashlib.sha256()
    for root in (folder, *others):
        for source in sorted(root.rglob("*.py")):
            status = source.stat()
            hasher.update(f"{source} {status.st_mtime_ns} {status.st_size}\n".encode())
    seen = folder / "__pycache__" / "kernels.stamp"
    try:
        if seen.is_file() and seen.read_text() == hasher.hexdigest():
            return
        for kind in ("nbi", "nbc"):
            for file in folder.rglob(f"__pycache__/*.{kind}"):
                file.unlink(missing_ok=True)
        seen.parent.mkdir(exist_ok=True)
        seen.write_text(hasher.hexdigest())
    except OSError:
        return
