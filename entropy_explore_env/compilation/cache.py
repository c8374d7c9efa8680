"""Compiled kernels on disk: each in a file whose name says what it was compiled from.

The name holds a digest of all that the code depends on, so that a file is never out of date, programs of
different versions do not overwrite each other's, and processes that compile the same write the same.
"""

from __future__ import annotations

import hashlib
import pickle
import pkgutil
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import config, sigutils
from numba.core.caching import _Cache
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps

from entropy_explore_env.compilation import announcement
from entropy_explore_env.compilation.folder import (
    SUFFIX,
    kernel_folder,
    mark_used,
    partial_name,
    remove_old_kernels,
)
from entropy_explore_env.compilation.stamps import NoStampError, describe_type, stamp


def _sources_digest() -> str:
    """A digest of the files that say how kernels are compiled, as they are when they are imported."""
    names = ("dispatchers.py", "kernels.py", "cache.py")
    sources = [pkgutil.get_data(__package__ or "", name) or b"" for name in names]
    return hashlib.sha256(b"".join(sources)).hexdigest()


_COMPILED_BY = _sources_digest()
_DIGEST_BYTES = 32
_SETTINGS = ("OPT", "BOUNDSCHECK", "LOOP_VECTORIZE", "SLP_VECTORIZE", "DEBUGINFO_DEFAULT", "ENABLE_PROFILING")
"""Of Numba's, by environment variables, those which change the code that it makes."""


class KernelCache(_Cache):
    """What a dispatcher of Numba's asks for compiled code.

    Args:
        kernel: Whose code it is.
        form: "outer" or "inner".
        rebuild: Makes a result of compiling from a target context and what its `_reduce` gave.
        kept: Whether code is kept on disk.
    """

    def __init__(
        self, kernel: Dispatcher, form: str, rebuild: Callable[[Any, Any], Any], *, kept: bool
    ) -> None:
        self._kernel = kernel
        self._form = form
        self._rebuild = rebuild
        self._kept = kept

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(kernel_folder())

    def enable(self) -> None:
        """Keep code on disk."""
        self._kept = True

    def disable(self) -> None:
        """Keep no code on disk."""
        self._kept = False

    def flush(self) -> None:
        """Nothing: no file is ever out of date."""

    def name_of(self, sig: Any, target_context: Any) -> str | None:  # noqa: ANN401
        """A digest of what the code for these types depends on; None = that is not known."""
        try:
            args, returned = _normal(sig)
            described = [stamp(self._kernel), *map(describe_type, args), str(returned)]
        except NoStampError as error:
            announcement.explain_no_stamp(str(error))
            return None
        described += [self._form, repr(target_context.codegen().magic_tuple()), *_environment()]
        return hashlib.sha256("\n".join(described).encode()).hexdigest()[:40]

    def load_overload(self, sig: Any, target_context: Any) -> Any:  # noqa: ANN401
        """A result of compiling, or None if there is none on disk."""
        target_context.refresh()
        path = self._path(sig, target_context)
        data = None if path is None else _read(path)
        if path is not None and data is not None:
            kept_sig, reduced = pickle.loads(data)
            if kept_sig == _normal(sig):
                mark_used(path)
                return self._rebuild(target_context, reduced)
        if self._form == "outer":
            announcement.begin_compiling(self._name(), kernel_folder())
        return None

    def save_overload(self, sig: Any, data: Any) -> None:  # noqa: ANN401
        """Write a result of compiling, unless it holds addresses of this process."""
        if self._form == "outer":
            announcement.end_compiling()
        path = self._path(sig, data.target_context)
        if path is None or data.library.has_dynamic_globals or data.lifted:
            return
        target = data.target_context
        target.refresh()
        try:
            _write(path, dumps((_normal(sig), data._reduce())))
        except OSError as error:
            announcement.explain_not_kept(path.parent, error)

    def _path(self, sig: Any, target_context: Any) -> Path | None:  # noqa: ANN401
        if not self._kept:
            return None
        name = self.name_of(sig, target_context)
        folder = kernel_folder()
        if folder is None:
            announcement.explain_not_kept(None, None)
        if name is None or folder is None:
            return None
        return folder / f"{self._name()}-{name}{SUFFIX}"

    def _name(self) -> str:
        function = self._kernel.py_func
        return re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__qualname__}")[-80:]


def _environment() -> list[str]:
    """What else the code depends on."""
    versions = (
        _COMPILED_BY,
        numba.__version__,
        llvmlite.__version__,
        np.__version__,
        sys.implementation.cache_tag,
    )
    return [repr(versions), repr([getattr(config, name, None) for name in _SETTINGS])]


def _normal(sig: Any) -> Any:  # noqa: ANN401
    args, returned = sigutils.normalize_signature(sig)
    return tuple(args), returned


def _read(path: Path) -> bytes | None:
    """What `_write` wrote; None where there is nothing, or something else."""
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
