"""Checks of a dataclass's fields; a value that is not allowed raises a SettingError that states what is."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeGuard, get_args, get_origin, get_type_hints

import numpy as np

from entropy_explore_env.errors import SettingError, one_of


def is_number(value: object) -> TypeGuard[float]:
    """Return whether it is a number that a float64 can hold: ±inf is one, NaN and booleans are not."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    try:
        return not math.isnan(float(value))
    except OverflowError:
        return False


def is_whole(value: object, least: int, most: int | None = None) -> TypeGuard[int]:
    """Return whether it is a whole number in a range; booleans are not."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        return False
    return bool(least <= value and (most is None or value <= most))


def check_whole(name: str, value: object, least: int) -> None:
    """Raise a SettingError unless a value, not a field, is a whole number ≥ `least`."""
    if not is_whole(value, least):
        raise SettingError(name, value, f"a whole number ≥ {least}")


def check_instance(name: str, value: object, kind: type) -> None:
    """Raise a SettingError unless a value, not a field, is an instance of a class."""
    if not isinstance(value, kind):
        raise SettingError(name, value, f"a {kind.__name__}")


def checked_path(name: str, value: object) -> Path:
    """Return a path from outside, with `~` at its beginning as the home folder that it stands for.

    Raises:
        SettingError: It is no path, or there is no such home folder.
    """
    text = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(text, str) or "\0" in text:
        raise SettingError(name, value, "the path of a file")
    try:
        return Path(text).expanduser()
    except RuntimeError:
        raise SettingError(name, value, "a path below a home folder that exists") from None


def check(settings: object, name: str, allowed: str, accepts: Callable[[Any], bool]) -> None:
    """Raise a SettingError unless the field is a number, not NaN, that `accepts` returns True for."""
    value = getattr(settings, name)
    if not is_number(value) or not accepts(value):
        raise SettingError(f"{type(settings).__name__}.{name}", value, allowed)


def check_positive(settings: object, *names: str) -> None:
    """Check that each field is a finite number > 0."""
    for name in names:
        check(settings, name, "a number > 0", lambda v: v > 0 and math.isfinite(v))


def check_within(
    settings: object, *names: str, least: float, most: float, zero: bool = False, inf: bool = False
) -> None:
    """Check that each field is a number in a range, ends included; or 0, or inf, where these are said."""
    others = [word for word, also in (("0", zero), ("inf", inf)) if also]
    allowed = " or ".join([f"a number from {least:g} to {most:g}", *others])
    for name in names:
        check(
            settings,
            name,
            allowed,
            lambda v: least <= v <= most or (zero and v == 0) or (inf and v == math.inf),
        )


def check_not_negative(settings: object, *names: str) -> None:
    """Check that each field is a finite number ≥ 0."""
    for name in names:
        check(settings, name, "a finite number ≥ 0", lambda v: v >= 0 and math.isfinite(v))


def check_count(settings: object, name: str, least: int, most: int) -> None:
    """Check that the field is a whole number in a range."""
    value = getattr(settings, name)
    if not is_whole(value, least, most):
        raise SettingError(
            f"{type(settings).__name__}.{name}", value, f"a whole number from {least} to {most}"
        )


def check_counts(
    settings: object, name: str, least: int, most: int, axes: tuple[str, ...] = ("x", "y", "z")
) -> None:
    """Check that the field is a whole number for each axis, each in a range."""
    value, count = getattr(settings, name), len(axes)
    if (
        not isinstance(value, tuple)
        or len(value) != count
        or not all(is_whole(n, least, most) for n in value)
    ):
        number = {2: "two", 3: "three"}[count]
        allowed = f"a tuple of {number} whole numbers ({', '.join(axes)}), each from {least} to {most}"
        raise SettingError(f"{type(settings).__name__}.{name}", value, allowed)


def check_choice(settings: object, name: str) -> None:
    """Check that the field is one of the values of the Literal that it is annotated with."""
    value, members = getattr(settings, name), get_args(annotations_of(type(settings))[name])
    if not isinstance(value, str) or value not in members:
        raise SettingError(f"{type(settings).__name__}.{name}", value, one_of(value, members))


@lru_cache(maxsize=64)
def annotations_of(kind: type) -> dict[str, Any]:
    """Return the evaluated annotation of each field of a dataclass, by name."""
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind)}


def check_fields(settings: object) -> None:
    """Check each field that is annotated as a bool, a text, one of some words, or a part of the settings."""
    for name, kind in annotations_of(type(settings)).items():
        if get_origin(kind) is Literal:
            check_choice(settings, name)
        elif isinstance(kind, type) and (kind in (bool, str) or dataclasses.is_dataclass(kind)):
            check_kind(settings, name, kind)


def check_kind(settings: object, name: str, kind: type) -> None:
    """Check that the field is an instance of a class."""
    value = getattr(settings, name)
    if not isinstance(value, kind):
        raise SettingError(
            f"{type(settings).__name__}.{name}", value, f"a {kind.__name__}{_as_part(kind, value)}"
        )


def _as_part(kind: type, value: object) -> str:
    """Return how a part of the settings is written, where a value of one of its fields was given."""
    if not dataclasses.is_dataclass(kind):
        return ""
    names = [each.name for each in dataclasses.fields(kind)]
    for name in names if isinstance(value, str) else ():
        try:
            kind(**{name: value})
        except (SettingError, TypeError):
            continue
        return f", or a mapping of its fields: {{{name!r}: {value!r}}}"
    shortened = ", ".join(names[:3]) + (", …" if len(names) > 3 else "")
    return f", or a mapping of its fields {shortened}"
