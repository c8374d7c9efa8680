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
from functools import cache
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
    remove_old_kernels,
    write_whole,
)
from entropy_explore_env.compilation.numba_parts import CODE_SETTINGS, Dispatcher, config, dumps, sigutils
from entropy_explore_env.compilation.stamps import NoStampError, describe_type, stamp

_SOURCES = ("dispatchers.py", "libraries.py", "kernels.py", "cache.py", "numba_parts.py", "shortcuts.py")
_COMPILED_BY = hashlib.sha256(
    b"".join(pkgutil.get_data(__package__ or "", name) or b"" for name in _SOURCES)
).hexdigest()
"""A digest of the files that say how kernels are compiled, as they are when they are imported."""
_DIGEST_BYTES = 32
_clean_up_once = cache(remove_old_kernels)


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

    def name_of(self, sig: Any, target: Any) -> tuple[str | None, int]:  # noqa: ANN401 - as Numba has them
        """Return a digest of what the code for these types depends on, and of how many kernels it is made.

        Args:
            sig: Types of arguments, or a signature.
            target: The target context.

        Returns:
            (digest, kernels); (None, 0) where the digest is not known.
        """
        try:
            (made_of, kernels), (args, returned) = stamp(self.kernel), _normal(sig)
            described = [made_of, *map(describe_type, args), str(returned)]
        except NoStampError as error:
            announcement.explain_no_stamp(str(error))
            return None, 0
        versions = numba.__version__, llvmlite.__version__, np.__version__, sys.implementation.cache_tag
        settings = [getattr(config, name, None) for name in CODE_SETTINGS]
        described += [self._form, repr((target.codegen().magic_tuple(), _COMPILED_BY, versions, settings))]
        return hashlib.sha256("\n".join(described).encode()).hexdigest()[:40], kernels

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
    try:
        content = b"" if path is None else path.read_bytes()
    except OSError:
        return None
    data = content[_DIGEST_BYTES:]
    if path is None or hashlib.sha256(data).digest() != content[:_DIGEST_BYTES]:
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
    data = dumps((_normal(sig), result._reduce()))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _clean_up_once(path.parent)
        write_whole(path, hashlib.sha256(data).digest() + data)
    except OSError as error:
        announcement.explain_not_kept(path.parent, error)


def _normal(sig: Any) -> Any:  # noqa: ANN401
    args, returned = sigutils.normalize_signature(sig)
    return tuple(args), returned
