"""The decorators of kernels: what is compiled, with which options, and kept on disk."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numba import typeof

from entropy_explore_env.compilation import second_process
from entropy_explore_env.compilation.dispatchers import Kernel
from entropy_explore_env.compilation.numba_parts import config
from entropy_explore_env.compilation.stamps import forget_digests

ASSERTING = os.environ.get("ENTROPY_EXPLORE_ASSERT", "0") != "0"
"""Whether kernels assert what holds unless they are wrong, such as that every event of a mission is used up.

Of a process, by the variable ENTROPY_EXPLORE_ASSERT=1. It is a constant of the kernels that name it: without
it nothing of an assertion is compiled, and code with assertions is kept beside that without.
"""

_OPTIONS: dict[str, Any] = {"nopython": True, "nogil": True, "error_model": "numpy", "boundscheck": None}
_LEAN_OPTIONS: dict[str, Any] = {**_OPTIONS, "_nrt": False}


def _compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:  # noqa: ANN401 - a dispatcher, or the function
    """As `njit`, in the form that `dispatchers` describes."""

    def decorate(function: Callable[..., Any]) -> Any:  # noqa: ANN401
        if getattr(config, "DISABLE_JIT", False):
            return function
        return Kernel(function, targetoptions=dict(options))

    return decorate


class InterpretedRecord(np.void):
    """An element of a structured array whose fields are attributes, those named as NumPy's own among them."""

    def __getattribute__(self, name: str) -> Any:  # noqa: ANN401 - whatever the field holds
        """Return a field, or what NumPy calls so."""
        there = np.void.__getattribute__(self, "dtype").fields
        return self[name] if there and name in there else np.void.__getattribute__(self, name)

    def __setattr__(self, name: str, value: Any) -> None:  # noqa: ANN401
        """Change a field of the array."""
        self[name] = value


def record_type(fields: list[tuple[Any, ...]]) -> np.dtype[Any]:
    """Return a structured type, aligned, whose elements have their fields as attributes, as kernels need.

    Compiled code reads any structured type so; where NUMBA_DISABLE_JIT=1 kernels are interpreted.
    """
    aligned = np.dtype(fields, align=True)
    return np.dtype((InterpretedRecord, aligned)) if getattr(config, "DISABLE_JIT", False) else aligned


kernel = _compiled(**_OPTIONS)
"""Compiled once and kept on disk; other threads run meanwhile; a division by zero gives inf or nan."""
lean_kernel = _compiled(**_LEAN_OPTIONS)
"""A kernel that makes no array and so counts no references: each row that it slices would cost a count.

Numba refuses to compile one that does make an array.
"""
inlined_kernel = _compiled(**_LEAN_OPTIONS, forceinline=True)
"""A lean kernel for what happens once a ray: it becomes part of each kernel that calls it.

Kernels that call it are kept on disk, it is not.
"""


def entry_point(compiled: Any, *arguments: Any) -> Callable[..., Any]:  # noqa: ANN401 - a kernel and its arguments
    """Return the machine code of a kernel for arguments of these types, which does not check types.

    For calls that happen every step: the call takes a tenth of the time. The caller makes sure that all later
    arguments have these types; others would be misread.
    """
    if not isinstance(compiled, Kernel):  # compiling is switched off
        return compiled
    types = tuple(typeof(argument) for argument in arguments)
    known = compiled.overloads.get(types)
    found: Any = compiled.compile(types) if known is None else known.entry_point
    return found


def compile_ahead(calls: Iterable[tuple[Any, tuple[Any, ...]]]) -> None:
    """Let a second process compile kernels that this one is about to call, unless they are on disk.

    Args:
        calls: Kernels, each with arguments of the types that it will be called with.
    """
    forget_digests()
    missing = []
    for compiled, arguments in calls:
        if not isinstance(compiled, Kernel):  # compiling is switched off
            continue
        types = tuple(typeof(argument) for argument in arguments)
        if not compiled.is_ready(types):
            missing.append((compiled, types))
    if missing:
        second_process.send(missing, start=True)
