"""Compiled code on disk: forgotten as soon as any source file that it may come from has changed.

Numba compiles a kernel anew when its own file changes, but not when a kernel that it calls changes in
another file: after an update, or an edit, old and new code would mix without a word.
"""

from __future__ import annotations

import hashlib
from pathlib import Path


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
        for index in folder.rglob("__pycache__/*.nbi"):
            index.unlink(missing_ok=True)
        seen.parent.mkdir(exist_ok=True)
        seen.write_text(hasher.hexdigest())
    except OSError:
        return
