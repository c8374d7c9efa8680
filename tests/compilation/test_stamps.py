"""The stamp of a kernel changes with all that its compiled code depends on, and with nothing else."""

import importlib
import pkgutil
import types
from enum import Enum, IntEnum
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

import entropy_explore_env
from entropy_explore_env.compilation.stamps import NoStampError, describe_type, forget_digests, stamp

SOURCE = '''"""A module."""
import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from entropy_explore_env.compilation.kernels import kernel, lean_kernel
import constants

CONSTANT = 1.5
DTYPE = np.dtype(np.float32)
TABLE = np.array([1.0, 2.0])
PAIR = (1, 2.0)


class Point(NamedTuple):
    x: float
    y: float


class Code(IntEnum):
    FREE = 0
    OCCUPIED = 1


def made(closed):
    @lean_kernel
    def within(x):
        return x + closed

    return within


within = made(3.0)


@lean_kernel
def leaf(x, scale=2.0):
    """Scaled."""
    return x * scale


@kernel
def root(x):
    """Everything."""
    # a comment
    p = Point(x, math.sqrt(x))
    a = np.zeros(3, DTYPE)
    if x > Code.OCCUPIED:
        raise ValueError("too large")
    return p.x + a[0] + leaf(x) + within(x) + CONSTANT + TABLE[0] + PAIR[1] + constants.FAR + unrelated(x)


@lean_kernel
def unrelated(x):
    return x
'''
CONSTANTS = "FAR = 8.0\nNEAR = 1.0\n"


def stamp_of(monkeypatch: pytest.MonkeyPatch, source: str = SOURCE, constants: str = CONSTANTS) -> str:
    other, module = types.ModuleType("constants"), types.ModuleType("mine")
    exec(compile(constants, "constants.py", "exec"), vars(other))
    monkeypatch.setitem(importlib.import_module("sys").modules, "constants", other)
    exec(compile(source, "mine.py", "exec"), vars(module))
    forget_digests()
    return stamp(module.root)[0]


EDITS = {
    "a callee": ("x * scale", "x / scale"),
    "a callee's default": ("scale=2.0", "scale=3.0"),
    "a callee's option": ("@lean_kernel\ndef leaf", "@kernel\ndef leaf"),
    "its own option": ("@kernel\ndef root", "@lean_kernel\ndef root"),
    "a constant": ("CONSTANT = 1.5", "CONSTANT = 1.25"),
    "a constant's type": ("CONSTANT = 1.5", "CONSTANT = 1"),
    "the sign of zero": ("CONSTANT = 1.5", "CONSTANT = -0.0"),
    "a dtype": ("np.float32", "np.float64"),
    "an array": ("[1.0, 2.0]", "[1.0, 3.0]"),
    "an array's dtype": ("[1.0, 2.0])", "[1.0, 2.0], np.float32)"),
    "a tuple": ("(1, 2.0)", "(1, 2)"),
    "the order of fields": ("    x: float\n    y: float", "    y: float\n    x: float"),
    "a field": ("    y: float\n", "    y: float\n    z: float = 0.0\n"),
    "a code": ("OCCUPIED = 1", "OCCUPIED = 2"),
    "a closure": ("made(3.0)", "made(4.0)"),
    "a message": ("too large", "too small"),
    "a kernel further below": ("return x\n", "return -x\n"),
}


@pytest.mark.parametrize("edit", EDITS)
def test_it_changes_with_what_the_code_depends_on(monkeypatch, edit):
    before, after = EDITS[edit]
    assert SOURCE.count(before) >= 1
    assert stamp_of(monkeypatch, SOURCE.replace(before, after)) != stamp_of(monkeypatch)


@pytest.mark.parametrize(
    ("constants", "changes"), [("FAR = 9.0\nNEAR = 1.0\n", True), ("FAR = 8.0\nNEAR = 2.0\n", False)]
)
def test_of_another_module_it_changes_with_the_constants_that_are_read(monkeypatch, constants, changes):
    assert (stamp_of(monkeypatch, constants=constants) != stamp_of(monkeypatch)) == changes


@pytest.mark.parametrize(
    "before, after",
    [
        ("# a comment", "# another comment\n    # of two lines"),
        ('"""Everything."""', '"""All of it."""'),
        ('"""A module."""', '"""A module."""\n\n\nUNUSED = 3\n\n\ndef plain():\n    return UNUSED\n'),
    ],
)
def test_it_does_not_change_with_the_rest_of_a_module(monkeypatch, before, after):
    assert before in SOURCE
    assert stamp_of(monkeypatch, SOURCE.replace(before, after)) == stamp_of(monkeypatch)


def test_a_docstring_that_is_read_counts():
    codes = []
    for text in ("one", "two"):
        space: dict[str, Any] = {}
        exec(f"def f():\n    '{text}'\n    return '{text}'\n", space)
        codes.append(numba.njit(space["f"]))
    forget_digests()
    assert stamp(codes[0]) != stamp(codes[1])


def test_globals_that_change_while_a_process_runs_leave_no_stamp():
    """Code with the old value may be linked already: what is compiled now must not be kept under either."""
    space: dict[str, Any] = {"CONSTANT": 1.0, "__name__": "mine"}
    exec("def f(x):\n    return x + CONSTANT\n", space)
    kernel = numba.njit(space["f"])
    forget_digests()
    before = stamp(kernel)
    space["CONSTANT"] = 2.0
    forget_digests()
    with pytest.raises(NoStampError, match="have changed"):
        stamp(kernel)
    space["CONSTANT"] = 1.0
    forget_digests()
    assert stamp(kernel) == before


def test_kernels_that_call_each_other_have_a_stamp():
    space: dict[str, Any] = {"__name__": "mine"}
    exec("def f(x):\n    return g(x)\ndef g(x):\n    return f(x)\n", space)
    space["f"], space["g"] = numba.njit(space["f"]), numba.njit(space["g"])
    forget_digests()
    assert stamp(space["f"]) != stamp(space["g"])


class Thing:
    pass


@pytest.mark.parametrize(
    "value",
    [Thing(), Thing, lambda x: x, np.array([None])],
    ids=["object", "class", "lambda", "array of objects"],
)
def test_what_is_not_known_has_no_stamp(value):
    space: dict[str, Any] = {"VALUE": value, "__name__": "mine"}
    exec("def f(x):\n    return VALUE\n", space)
    forget_digests()
    with pytest.raises(NoStampError):
        stamp(numba.njit(space["f"]))


def test_types_are_described_with_what_they_are_made_of():
    def types_of(source: str, value: str) -> str:
        space: dict[str, Any] = {
            "NamedTuple": NamedTuple,
            "Enum": Enum,
            "IntEnum": IntEnum,
            "__name__": "mine",
        }
        exec(source, space)
        return describe_type(numba.typeof(eval(value, space)))

    point = "class Point(NamedTuple):\n    {}: float\n    {}: float\n"
    described = types_of(point.format("x", "y"), "Point(1.0, 2.0)")
    assert types_of(point.format("y", "x"), "Point(1.0, 2.0)") != described
    assert types_of(point.format("x", "y"), "Point(2.0, 1.0)") == described
    held = types_of(point.format("x", "y"), "(Point(1.0, 2.0), 1)")
    assert types_of(point.format("y", "x"), "(Point(1.0, 2.0), 1)") != held
    code = "class Code(IntEnum):\n    A = {}\n"
    assert types_of(code.format(1), "Code.A") != types_of(code.format(2), "Code.A")


def library_kernels() -> list[Dispatcher]:
    found: dict[int, Dispatcher] = {}
    for package in (entropy_explore_env, importlib.import_module("baselines.strategies")):
        for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            if module.name.rpartition(".")[2] == "__main__" or "rllib" in module.name:
                continue
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, Dispatcher):
                    found[id(value)] = value
    return list(found.values())


def test_each_kernel_has_a_stamp_of_its_own():
    forget_digests()
    kernels = library_kernels()
    assert len({stamp(kernel) for kernel in kernels}) == len(kernels) > 150
