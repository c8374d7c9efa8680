"""Compiled kernels on disk: each in a file whose name says what it was compiled from.

The name holds a digest of all that the code depends on, so that a file is never out of date, programs of
different versions do not overwrite each other's, and processes that compile the same write the same.

The files are pickles, as those of Numba's own cache: whoever can write into their folder can run code as the
user. It is in the user's own cache folder; a `NUMBA_CACHE_DIR` must not be writable for others either.
"""

from __future__ import annotations

import hashlib
import pickle
import pkgutil
import re
import sys
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np

from entropy_explore_env.compilation import announcement
from entropy_explore_env.compilation.folder import (
    SUFFIX,
    kernel_folder,
    mark_used,
    partial_name,
    remove_old_kernels,
)
from entropy_explore_env.compilation.numba_parts import CODE_SETTINGS, Dispatcher, config, dumps, sigutils
from entropy_explore_env.compilation.stamps import NoStampError, describe_type, stamp

_SOURCES = ("dispatchers.py", "libraries.py", "kernels.py", "cache.py", "numba_parts.py")
_COMPILED_BY = hashlib.sha256(
    b"".join(pkgutil.get_data(__package__ or "", name) or b"" for name in _SOURCES)
).hexdigest()
"""A digest of the files that say how kernels are compiled, as they are when they are imported."""
_DIGEST_BYTES = 32


class KernelCache:
    """The compiled code of one kernel, on disk.

    Args:
        kernel: Whose code it is.
        form: "outer" or "inner".
        kept: Whether code is kept on disk.
    """

    def __init__(self, kernel: Dispatcher, form: str, *, kept: bool) -> None:
        """Read and write nothing yet."""
        self.kernel, self._form, self._kept = kernel, form, kept

    def name_of(self, sig: Any, target: Any) -> str | None:  # noqa: ANN401 - a signature, a target context
        """Return a digest of what the code for these types depends on; None = that is not known."""
        try:
            args, returned = _normal(sig)
            described = [stamp(self.kernel), *map(describe_type, args), str(returned)]
        except NoStampError as error:
            announcement.explain_no_stamp(str(error))
            return None
        described += [self._form, repr(target.codegen().magic_tuple()), *_environment()]
        return hashlib.sha256("\n".join(described).encode()).hexdigest()[:40]

    def path_of(self, name: str | None) -> Path | None:
        """Return the file of the code with this digest; None = it is not kept."""
        folder = kernel_folder()
        if self._kept and folder is None:
            announcement.explain_not_kept(None, None)
        if not self._kept or name is None or folder is None:
            return None
        return folder / f"{self.module_name}-{name}{SUFFIX}"

    @property
    def module_name(self) -> str:
        """The kernel's name, with that of its module."""
        function = self.kernel.py_func
        return re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__qualname__}")[-80:]


def load(path: Path | None, sig: Any) -> Any:  # noqa: ANN401 - a signature; what a result of compiling reduces to
    """Return what was written into a file for a signature; None = nothing, or something else."""
    if path is None:
        return None
    data = _read(path)
    if data is None:
        return None
    kept_sig, reduced = pickle.loads(data)
    if kept_sig != _normal(sig):
        return None
    mark_used(path)
    return reduced


def save(path: Path | None, sig: Any, result: Any) -> None:  # noqa: ANN401 - a signature, a result of compiling
    """Write a result of compiling, unless it holds addresses of this process."""
    if path is None or result.library.has_dynamic_globals or result.lifted:
        return
    result.target_context.refresh()
    try:
        _write(path, dumps((_normal(sig), result._reduce())))
    except OSError as error:
        announcement.explain_not_kept(path.parent, error)


def _environment() -> list[str]:
    """Return what else the code depends on."""
    versions = (
        _COMPILED_BY,
        numba.__version__,
        llvmlite.__version__,
        np.__version__,
        sys.implementation.cache_tag,
    )
    return [repr(versions), repr([getattr(config, name, None) for name in CODE_SETTINGS])]


def _normal(sig: Any) -> Any:  # noqa: ANN401
    args, returned = sigutils.normalize_signature(sig)
    return tuple(args), returned


def _read(path: Path) -> bytes | None:
    """Return what `_write` wrote; None where there is nothing, or something else."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    data = content[_DIGEST_BYTES:]
    return data if hashlib.sha256(data).digest() == content[:_DIGEST_BYTES] else None


_cleaned: set[Path] = set()


def _write(path: Path, data: bytes) -> None:
    """Write a file as a whole or not at all; the first of a process removes old ones."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.parent not in _cleaned:
        _cleaned.add(path.parent)
        remove_old_kernels(path.parent)
    part = partial_name(path)
    try:
        part.write_bytes(hashlib.sha256(data).digest() + data)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
