"""Checks of a dataclass's fields: what is not allowed raises a SettingError that says what is."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, get_args

import numpy as np

from entropy_explore_env.errors import SettingError


def check(settings: object, name: str, allowed: str, accepts: Callable[[Any], bool]) -> None:
    """Raise a SettingError unless the field is a number that `accepts` takes; NaN never is."""
    value = getattr(settings, name)
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if not number or math.isnan(value) or not accepts(value):
        raise SettingError(f"{type(settings).__name__}.{name}", value, allowed)


def check_positive(settings: object, *names: str, finite: bool = True) -> None:
    """Each field is a number > 0, finite unless said otherwise."""
    allowed = "a number > 0" + ("" if finite else ", or inf")
    for name in names:
        check(settings, name, allowed, lambda v: v > 0 and (math.isfinite(v) or not finite))


def check_not_negative(settings: object, *names: str) -> None:
    """Each field is a finite number ≥ 0."""
    for name in names:
        check(settings, name, "a finite number ≥ 0", lambda v: v >= 0 and math.isfinite(v))


def check_count(settings: object, name: str, least: int, most: int) -> None:
    """The field is a whole number in a range."""
    value = getattr(settings, name)
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not least <= value <= most:
        raise SettingError(
            f"{type(settings).__name__}.{name}", value, f"a whole number from {least} to {most}"
        )


def check_counts(settings: object, name: str, least: int, most: int) -> None:
    """The field is three whole numbers, each in a range."""
    value = getattr(settings, name)
    whole = isinstance(value, tuple) and len(value) == 3
    if not whole or not all(
        isinstance(n, int | np.integer) and not isinstance(n, bool) and least <= n <= most for n in value
    ):
        allowed = f"three whole numbers (x, y, z), each from {least} to {most}"
        raise SettingError(f"{type(settings).__name__}.{name}", value, allowed)


def check_choice(settings: object, name: str, choices: object) -> None:
    """The field is one of the values of a Literal."""
    value, members = getattr(settings, name), get_args(choices)
    if value not in members:
        raise SettingError(f"{type(settings).__name__}.{name}", value, "one of " + ", ".join(members))


def check_kind(settings: object, name: str, kind: type) -> None:
    """The field is an instance of a class."""
    value = getattr(settings, name)
    if not isinstance(value, kind):
        raise SettingError(f"{type(settings).__name__}.{name}", value, f"a {kind.__name__}")
