"""Wrong values of arguments, and where each of them would be right."""

import dataclasses
import enum
import typing
from collections.abc import Callable
from typing import Any

import numpy as np


class Is(enum.Flag):
    """What a wrong value is: where this is allowed, the value is not wrong."""

    NONE = enum.auto()
    BOOL = enum.auto()
    NEGATIVE = enum.auto()
    TEXT = enum.auto()
    NO_NAMES = enum.auto()
    NO_ENTRIES = enum.auto()
    CALLABLE = enum.auto()
    LARGE = enum.auto()
    STRANGE = enum.auto()
    """Allowed nowhere."""


class Unprintable:
    """Neither shown, compared nor made an array of."""

    def __repr__(self):
        raise RuntimeError("cannot be shown")

    def __eq__(self, other):
        raise RuntimeError("cannot be compared")

    __hash__ = None  # type: ignore[assignment]

    def __array__(self, *about, **more):
        raise RuntimeError("no array")


VALUES: tuple[tuple[Is, Callable[[], Any]], ...] = (
    (Is.NONE, lambda: None),
    (Is.BOOL, lambda: True),
    (Is.BOOL, lambda: False),
    (Is.NEGATIVE, lambda: -1),
    (Is.NEGATIVE, lambda: np.float32(-0.5)),
    (Is.STRANGE, lambda: float("nan")),
    (Is.STRANGE, lambda: float("-inf")),
    (Is.LARGE, lambda: 10**5000),
    (Is.STRANGE, lambda: -(10**5000)),
    (Is.STRANGE, lambda: 1j),
    (Is.TEXT, lambda: "x"),
    (Is.TEXT, lambda: "3"),
    (Is.STRANGE, lambda: b"x"),
    (Is.NO_ENTRIES, lambda: ()),
    (Is.NO_ENTRIES, list),
    (Is.STRANGE, lambda: [1, 2]),
    (Is.STRANGE, lambda: [[1], [2, 3]]),
    (Is.STRANGE, lambda: [None, "x"]),
    (Is.STRANGE, lambda: {1, 2}),
    (Is.NO_NAMES, lambda: {}),
    (Is.STRANGE, lambda: {1: 2}),
    (Is.STRANGE, lambda: {"x": object()}),
    (Is.STRANGE, object),
    (Is.CALLABLE, lambda: len),
    (Is.CALLABLE, lambda: int),
    (Is.STRANGE, lambda: ...),
    (Is.STRANGE, lambda: range(9)),
    (Is.STRANGE, lambda: iter([1, 2])),
    (Is.STRANGE, lambda: np.array([1, 2])),
    (Is.STRANGE, lambda: np.array("x")),
    (Is.STRANGE, lambda: np.array(None)),
    (Is.STRANGE, lambda: np.zeros((2, 4))),
    (Is.STRANGE, lambda: np.full(5, np.nan)),
    (Is.STRANGE, lambda: np.zeros((0, 5))),
    (Is.STRANGE, lambda: np.datetime64("2026-11-22")),
    (Is.STRANGE, Unprintable),
)


PARTS = ("grid", "robot", "sensor", "channel", "ending", "reward", "action", "observation")


def fields(kind: type) -> dict[str, Is]:
    """The fields of settings, and which of the wrong values are right in them."""
    found, hints = {}, typing.get_type_hints(kind)
    for name in (field.name for field in dataclasses.fields(kind)):
        hint = hints[name]
        allowed = Is.NONE if type(None) in typing.get_args(hint) else Is(0)
        if hint is bool:
            allowed |= Is.BOOL
        if name == "name":
            allowed |= Is.TEXT
        if dataclasses.is_dataclass(hint):
            allowed |= Is.NO_NAMES
        if name == "extra_kinds":
            allowed |= Is.NO_ENTRIES
        found[name] = allowed
    return found


def put(numbers: list[Any], place: int, value: Any) -> tuple[Any, ...]:
    """The numbers as a tuple, one of them replaced."""
    return (*numbers[:place], value, *numbers[place + 1 :])


def hashable(value: Any) -> Any:
    """The value, or where it is no key of a dict its type."""
    try:
        hash(value)
    except TypeError:
        return type(value)
    return value
