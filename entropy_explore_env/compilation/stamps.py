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
import sys
import types
import weakref
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from entropy_explore_env.compilation.numba_parts import Dispatcher
from entropy_explore_env.compilation.numba_parts import types as numba_types

_TRUSTED = frozenset(sys.stdlib_module_names) | {"numpy", "numba", "llvmlite"}
"""Packages of which the stamp names no more than the version: what comes from them has a name."""
_LOAD_GLOBAL = dis.opmap["LOAD_GLOBAL"]
_EXTENDED_ARG = dis.opmap["EXTENDED_ARG"]
_LOAD_FIRST_CONSTANT = tuple(
    bytes((dis.opmap[name], 0)) for name in ("LOAD_CONST", "RETURN_CONST") if name in dis.opmap
)
_NAME_SHIFT = 1 if sys.version_info >= (3, 11) else 0  # the lowest bit says that NULL is pushed as well
_NO_VALUE = object()


class NoStampError(Exception):
    """A kernel depends on something which has no description in bytes."""


class _Part:
    """One function of a tree of calls: a digest of what it holds itself, and the kernels that it calls."""

    def __init__(self, digest: bytes, calls: list[Dispatcher]) -> None:
        self.digest = digest
        self.calls = calls


_parts: dict[int, _Part] = {}
_first_digests: weakref.WeakKeyDictionary[Dispatcher, bytes] = weakref.WeakKeyDictionary()


def forget_parts() -> None:
    """From here on, globals may have other values."""
    _parts.clear()


def stamp(kernel: Dispatcher) -> str:
    """Return a digest of the byte code, the options and the constants of a kernel and of all that it calls.

    Raises:
        NoStampError: It reaches something that cannot be described, or the globals of a kernel that it
            reaches have changed since that one may have been compiled.
    """
    return _stamp_and_size(kernel)[0]


def tree_size(kernel: Dispatcher) -> int:
    """Return how many kernels one is made of: itself and all below it; 0 where it has no stamp."""
    try:
        return _stamp_and_size(kernel)[1]
    except NoStampError:
        return 0


def _stamp_and_size(kernel: Dispatcher) -> tuple[str, int]:
    numbers = {id(kernel): 0}
    reached = [kernel]
    hasher = hashlib.sha256()
    for caller in reached:
        part = _parts.get(id(caller))
        if part is None:
            part = _parts[id(caller)] = _part(caller)
        hasher.update(part.digest)
        for callee in part.calls:
            if id(callee) not in numbers:
                numbers[id(callee)] = len(reached)
                reached.append(callee)
            hasher.update(numbers[id(callee)].to_bytes(4, "little"))
    return hasher.hexdigest(), len(reached)


def _part(kernel: Dispatcher) -> _Part:
    description = _Description()
    try:
        description.add_function(kernel.py_func, kernel.targetoptions)
    except NoStampError as error:
        raise NoStampError(f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}: {error}") from None
    digest = hashlib.sha256("\n".join(description.words).encode()).digest()
    if _first_digests.setdefault(kernel, digest) != digest:
        raise NoStampError(f"globals of {kernel.py_func.__qualname__} have changed since it was compiled")
    return _Part(digest, description.calls)


@lru_cache(maxsize=4096)
def describe_type(kind: numba_types.Type) -> str:
    """One of the types for which a kernel is compiled; NamedTuples and Enums with what they are made of.

    Raises:
        NoStampError: A class cannot be described.
    """
    description = _Description()
    description.add_type(kind)
    return "\n".join(description.words)


class _Description:
    """Words that describe a function, one after the other; equal words, equal compiled code."""

    def __init__(self) -> None:
        self.words: list[str] = []
        self.calls: list[Dispatcher] = []

    def add_function(self, function: types.FunctionType, options: dict[str, Any]) -> None:
        """Its code, and the values that it takes from outside."""
        self._say("function", function.__module__, function.__qualname__, sorted(options.items()))
        self._add_code(function.__code__, function.__doc__)
        self.add_value(function.__defaults__)
        self.add_value(function.__kwdefaults__)
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
            self._say("closure", name)
            self.add_value(cell.cell_contents)
        attributes = _names(function.__code__)
        for name in sorted(_global_names(function.__code__)):
            self._say("global", name)
            value = function.__globals__.get(name, _NO_VALUE)
            if value is _NO_VALUE:
                self._say("builtin")
            elif isinstance(value, types.ModuleType):
                self._add_module(value, attributes, set())
            else:
                self.add_value(value)

    def add_value(self, value: Any) -> None:  # noqa: ANN401 - of any global variable
        """Add a constant of a kernel."""
        kind = type(value)
        if value is None or kind in (bool, int, float, complex, str, bytes):
            self._say(kind.__name__, repr(value))
        elif isinstance(value, Dispatcher):
            self._say("kernel")
            self.calls.append(value)
        elif isinstance(value, enum.Enum):
            self._say("member", value.name)
            self._add_class(kind)
        elif isinstance(value, (tuple, frozenset, list)):
            self._add_items(value)
        elif kind is dict:
            self._add_items([item for pair in value.items() for item in pair])
        elif isinstance(value, np.dtype):
            self._say("dtype", repr(value), value.itemsize)
        elif isinstance(value, np.generic):
            self._say("scalar", repr(value.dtype), value.tobytes().hex())
        elif kind is np.ndarray:
            self._add_array(value)
        elif isinstance(value, numba_types.Type):
            self.add_type(value)
        elif isinstance(value, type):
            self._add_class(value)
        elif isinstance(value, types.CodeType):
            self._add_code(value, None)
        elif _origin(value) in _TRUSTED:
            self._say("named", _origin(value), getattr(value, "__qualname__", None) or value.__name__)
        else:
            raise NoStampError(f"what {value!r} depends on is not known")

    def add_type(self, signature: Any) -> None:  # noqa: ANN401
        """Add a type of Numba's, a tuple of them, or a signature."""
        self._say(signature)
        if isinstance(signature, (tuple, list)):
            for inner in signature:
                self.add_type(inner)
            return
        if not isinstance(signature, numba_types.Type):  # a signature
            for inner in (*signature.args, signature.return_type):
                self.add_type(inner)
            return
        if isinstance(signature, numba_types.Callable):
            raise NoStampError(f"{signature} is an argument")
        for name in ("instance_class", "instance_type"):
            held = getattr(signature, name, None)
            if isinstance(held, type):
                self._add_class(held)
        for name in ("types", "dtype", "type"):
            held = getattr(signature, name, None)
            for inner in held if isinstance(held, tuple) else (held,):
                if isinstance(inner, numba_types.Type) and inner is not signature:
                    self.add_type(inner)

    def _say(self, *words: object) -> None:
        self.words.append(repr([str(word) for word in words]))

    def _add_code(self, code: types.CodeType, docstring: str | None) -> None:
        constants = code.co_consts
        first_is_read = any(load in code.co_code for load in _LOAD_FIRST_CONSTANT)
        if docstring is not None and constants and constants[0] == docstring and not first_is_read:
            constants = (None, *constants[1:])
        self._say("code", code.co_code.hex(), getattr(code, "co_exceptiontable", b"").hex(), code.co_flags)
        self._say(code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
        self._say(code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount)
        self._add_items(constants)

    def _add_items(self, values: Any) -> None:  # noqa: ANN401 - a tuple, a list or a set
        self._add_class(type(values))
        self._say(len(values))
        for value in sorted(values, key=repr) if isinstance(values, frozenset) else values:
            self.add_value(value)

    def _add_array(self, array: np.ndarray) -> None:
        if array.dtype.hasobject:
            raise NoStampError("an array of Python objects")
        flags = array.flags
        self._say(
            "array", repr(array.dtype), array.shape, flags.c_contiguous, flags.f_contiguous, flags.aligned
        )
        self._say(hashlib.sha256(array.tobytes()).hexdigest())

    def _add_class(self, kind: type) -> None:
        """Add a class that kernels know: NamedTuples, Enums, exceptions, types of numbers."""
        self._say("class", kind.__module__, kind.__qualname__)
        if issubclass(kind, enum.Enum):
            for name, member in kind.__members__.items():
                self._say("member", name)
                self.add_value(member.value)
        elif issubclass(kind, tuple) and hasattr(kind, "_fields"):
            named: Any = kind
            self._say(named._fields)
            self.add_value(named._field_defaults)
        elif kind.__module__.partition(".")[0] not in _TRUSTED and not issubclass(kind, BaseException):
            raise NoStampError(f"what the class {kind.__qualname__} does is not known")
        if kind.__module__ == "__main__":
            raise NoStampError(f"the class {kind.__qualname__} belongs to a script, not to a module")

    def _add_module(self, module: types.ModuleType, attributes: set[str], seen: set[int]) -> None:
        """Those of its values whose names occur in the kernel."""
        self._say("module", module.__name__)
        if module.__name__.partition(".")[0] in _TRUSTED or id(module) in seen:
            return
        seen.add(id(module))
        for name in sorted(attributes & vars(module).keys()):
            self._say("attribute", name)
            value = vars(module)[name]
            if isinstance(value, types.ModuleType):
                self._add_module(value, attributes, seen)
            else:
                self.add_value(value)


def _origin(value: Any) -> str:  # noqa: ANN401
    """Return the package that a function comes from, or the class of an object that is not a function."""
    own = getattr(value, "__module__", None)
    if isinstance(own, str) and hasattr(value, "__name__"):
        return own.partition(".")[0]
    return type(value).__module__.partition(".")[0] if hasattr(value, "__name__") else ""


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)


def _names(code: types.CodeType) -> set[str]:
    """Names of globals and attributes that occur in a function and in functions within it."""
    return {name for inner in _codes(code) for name in inner.co_names}


def _global_names(code: types.CodeType) -> set[str]:
    """Names of the globals that a function reads, functions within it as well."""
    names: set[str] = set()
    for inner in _codes(code):
        extended = 0
        for operation, argument in zip(inner.co_code[::2], inner.co_code[1::2], strict=True):
            extended = extended << 8 | argument
            if operation == _LOAD_GLOBAL:
                names.add(inner.co_names[extended >> _NAME_SHIFT])
            if operation != _EXTENDED_ARG:
                extended = 0
    return names
