"""A digest of all that the compiled code of a kernel depends on.

Numba compiles the byte code of a function, and takes the values of its global variables as constants. So
the stamp is made of just these: the byte code without docstring, line numbers and file name; the values of
the globals that it names; and the same of each kernel that it calls. It is made of the objects in memory:
what the files say now does not matter, and comments and other functions of the module do not either.

Some things have no description in bytes, such as an object of a class of one's own. A kernel which reaches
one has no stamp, and is compiled anew in each process.
"""

from __future__ import annotations

import dis
import enum
import hashlib
import io
import pickle
import sys
import types
import weakref
from functools import cache, lru_cache
from typing import Any

import numpy as np

from entropy_explore_env.compilation.numba_parts import Dispatcher
from entropy_explore_env.compilation.numba_parts import types as numba_types

_TRUSTED = frozenset(sys.stdlib_module_names) | {"numpy", "numba", "llvmlite"}
"""Packages of which the stamp names no more than the version: what comes from them has a name."""
_LOAD_FIRST_CONSTANT = tuple(
    bytes((dis.opmap[name], 0)) for name in ("LOAD_CONST", "RETURN_CONST") if name in dis.opmap
)


class NoStampError(Exception):
    """A kernel depends on something which has no description in bytes."""


_first_digests: weakref.WeakKeyDictionary[Dispatcher, bytes] = weakref.WeakKeyDictionary()


def stamp(kernel: Dispatcher) -> tuple[str, int]:
    """Return a digest of what a kernel and all kernels below it are made of, and how many these are.

    That is their byte code, their options and their constants.

    Raises:
        NoStampError: It reaches something that cannot be described, or the globals of a kernel that it
            reaches have changed since that one may have been compiled.
    """
    reached, hasher = {kernel: 0}, hashlib.sha256()
    waiting = [kernel]
    for caller in waiting:
        digest, callees = _own_digest(caller)
        hasher.update(digest)
        for callee in callees:
            if callee not in reached:
                reached[callee] = len(reached)
                waiting.append(callee)
            hasher.update(reached[callee].to_bytes(4, "little"))
    return hasher.hexdigest(), len(reached)


@cache
def _own_digest(kernel: Dispatcher) -> tuple[bytes, list[Dispatcher]]:
    """Return a digest of what a kernel holds itself, and the kernels that it names."""
    function = kernel.py_func
    try:
        digest, callees = _digest([sorted(kernel.targetoptions.items()), *_held_by(function)])
    except NoStampError as error:
        raise NoStampError(f"{function.__module__}.{function.__qualname__}: {error}") from None
    if _first_digests.setdefault(kernel, digest) != digest:
        raise NoStampError(f"globals of {function.__qualname__} have changed since it was compiled")
    return digest, callees


forget_digests = _own_digest.cache_clear
"""From here on, globals may have other values."""


@lru_cache(maxsize=4096)
def describe_type(kind: numba_types.Type) -> str:
    """Describe one of the types for which a kernel is compiled, with the NamedTuples and Enums in it.

    Raises:
        NoStampError: A class cannot be described.
    """
    return _digest(kind)[0].hex()


def _digest(value: object) -> tuple[bytes, list[Dispatcher]]:
    """Return a digest of a value, and the kernels in it."""
    written = io.BytesIO()
    pickler = _Describing(written, protocol=5)
    pickler.kernels = []
    pickler.fast = True  # no memo: equal values give equal bytes, whether or not they are one object
    pickler.dump(value)
    return hashlib.sha256(written.getvalue()).digest(), pickler.kernels


class _Describing(pickle.Pickler):
    """Writes what compiled code may depend on in bytes that no process changes; they are never read."""

    kernels: list[Dispatcher]

    def reducer_override(self, value: Any) -> Any:  # noqa: ANN401 - of any global variable
        """Describe what pickle would refer to by name alone, and refuse what nothing is known of."""
        kind = type(value)
        if value is str or isinstance(value, (np.dtype, np.generic, enum.Enum)):
            return NotImplemented
        if isinstance(value, Dispatcher):
            self.kernels.append(value)
            return _said("kernel")
        if isinstance(value, numba_types.Type):
            return _said(str(value), *_parts_of_type(value))
        if isinstance(value, type):
            return _said(*_parts_of_class(value))
        if isinstance(value, types.CodeType):
            return _said(*_parts_of_code(value, None))
        if kind is np.ndarray and not value.dtype.hasobject:
            flags = value.flags
            aligned = flags.c_contiguous, flags.f_contiguous, flags.aligned
            return _said(value.dtype, value.shape, aligned, value.tobytes())
        if _package(value) in _TRUSTED:
            return _said(_package(value), getattr(value, "__qualname__", value.__name__))
        raise NoStampError(f"what {value!r} depends on is not known")


def _said(*words: object) -> tuple[Any, tuple[object, ...]]:
    """Return words in the form in which pickle writes an object."""
    return str, words


def _package(value: Any) -> str:  # noqa: ANN401
    """Return the package that a function or a module comes from; "" where something has no name."""
    if isinstance(value, types.ModuleType):
        return value.__name__.partition(".")[0]
    owner = getattr(value, "__module__", None) or type(value).__module__
    return owner.partition(".")[0] if hasattr(value, "__name__") else ""


def _held_by(function: types.FunctionType) -> list[object]:
    """Return a function's code, and the values that it takes from outside."""
    code = function.__code__
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    held: list[object] = [function.__module__, function.__qualname__, *_parts_of_code(code, function.__doc__)]
    held += [function.__defaults__, function.__kwdefaults__, cells]
    names = _names(code)
    for name in sorted(names & function.__globals__.keys()):
        held += [name, *_with_attributes(function.__globals__[name], names, set())]
    return held


def _names(code: types.CodeType) -> set[str]:
    """Return names of globals and attributes that occur in a function and in functions within it."""
    within = [constant for constant in code.co_consts if isinstance(constant, types.CodeType)]
    return set(code.co_names).union(*map(_names, within))


def _with_attributes(value: object, names: set[str], seen: set[int]) -> list[object]:
    """Return a value; in place of a module of one's own, those of its values whose names occur."""
    if not isinstance(value, types.ModuleType) or _package(value) in _TRUSTED or id(value) in seen:
        return [value] if id(value) not in seen else []
    seen.add(id(value))
    held: list[object] = [value.__name__]
    for name in sorted(names & vars(value).keys()):
        held += [name, *_with_attributes(vars(value)[name], names, seen)]
    return held


def _parts_of_code(code: types.CodeType, docstring: str | None) -> list[object]:
    constants = code.co_consts
    first_is_read = any(load in code.co_code for load in _LOAD_FIRST_CONSTANT)
    if docstring is not None and constants and constants[0] == docstring and not first_is_read:
        constants = (None, *constants[1:])
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    return [code.co_code, getattr(code, "co_exceptiontable", b""), names, counts, constants]


def _parts_of_type(kind: numba_types.Type) -> list[object]:
    """Return the classes and types that a type of Numba's is made of."""
    if isinstance(kind, numba_types.Callable):
        raise NoStampError(f"{kind} is an argument")
    held: list[object] = []
    for name in ("instance_class", "instance_type", "types", "dtype", "type"):
        part = getattr(kind, name, None)
        of_type = isinstance(part, numba_types.Type) and part is not kind
        if of_type or isinstance(part, (type, tuple)):
            held.append(part)
    return held


def _parts_of_class(kind: type) -> list[object]:
    """Return what kernels know of a class: NamedTuples, Enums, exceptions, types of numbers."""
    if kind.__module__ == "__main__":
        raise NoStampError(f"the class {kind.__qualname__} belongs to a script, not to a module")
    name = f"class {kind.__module__}.{kind.__qualname__}"
    if issubclass(kind, enum.Enum):
        return [name, [(member, kind[member].value) for member in kind.__members__]]
    if issubclass(kind, tuple) and hasattr(kind, "_fields"):
        named: Any = kind
        return [name, named._fields, named._field_defaults]
    if kind.__module__.partition(".")[0] not in _TRUSTED and not issubclass(kind, BaseException):
        raise NoStampError(f"what the class {kind.__qualname__} does is not known")
    return [name]
