"""Settings as JSON and back, without loss: every number exact, infinity as the text "inf"."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from entropy_explore_env.errors import SettingError, did_you_mean
from entropy_explore_env.settings.scenario import Scenario

Settings = TypeVar("Settings")
INFINITY = "inf"
"""JSON has no infinity; where a number belongs, this text stands for it."""


def settings_of(value: Any) -> Any:  # noqa: ANN401 - a dataclass, or what one may hold
    """Return settings as what JSON holds: objects, lists, texts, numbers, true, false and null.

    `scenario_of` and `dataclass_of` give the same settings back, also after `json.dumps` and `json.loads`.
    """
    if dataclasses.is_dataclass(value):
        return {field.name: settings_of(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, tuple):
        return [settings_of(each) for each in value]
    if isinstance(value, np.generic):
        return settings_of(value.item())
    return INFINITY if isinstance(value, float) and value == math.inf else value


def scenario_of(settings: Any) -> Scenario:  # noqa: ANN401 - whatever a file holds
    """Return the scenario with these settings; what is missing has its default, if it has one.

    Raises:
        SettingError: A setting is unknown, missing, of the wrong kind or out of its range.
    """
    return dataclass_of(Scenario, settings)


def dataclass_of(kind: type[Settings], settings: Any, name: str = "settings") -> Settings:  # noqa: ANN401
    """Return a dataclass from an object of its fields, as JSON holds it.

    Args:
        kind: The dataclass.
        settings: As `settings_of` gives them; what is missing has its default.
        name: Name of the settings, for errors.

    Raises:
        SettingError: See `scenario_of`.
    """
    return _decoded(kind, settings, name)


def _decoded(hint: Any, value: Any, name: str) -> Any:  # noqa: ANN401 - whatever a setting may be
    """Return the value of a setting of annotation `hint`; the settings check themselves what it is."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return _decoded(_member(hint, value), value, name)
    if dataclasses.is_dataclass(hint):
        return _part(typing.cast(type, hint), value, name)
    if typing.get_origin(hint) is tuple and isinstance(value, list):
        kinds = typing.get_args(hint)
        repeated = len(kinds) == 2 and kinds[1] is Ellipsis
        if not repeated and len(kinds) != len(value):
            raise SettingError(name, value, f"a list of {len(kinds)}")
        return tuple(
            _decoded(kinds[0] if repeated else kinds[place], each, f"{name}[{place}]")
            for place, each in enumerate(value)
        )
    return math.inf if hint is float and value == INFINITY else value


def _member(hint: Any, value: Any) -> Any:  # noqa: ANN401 - of a union: the kind that the value is of
    for member in typing.get_args(hint):
        is_part, is_tuple = dataclasses.is_dataclass(member), typing.get_origin(member) is tuple
        if isinstance(value, Mapping) if is_part else isinstance(value, list) if is_tuple else False:
            return member
    return float if value == INFINITY and float in typing.get_args(hint) else None


def _part(kind: type, value: Any, name: str) -> Any:  # noqa: ANN401 - an object of the kind
    """Return a dataclass from an object of its fields."""
    hints = _hints(kind)
    if not isinstance(value, Mapping):
        raise SettingError(name, value, f"an object with the fields of {kind.__name__}")
    for field, given in value.items():
        if field not in hints:
            raise SettingError(
                f"{kind.__name__}.{field}",
                given,
                "one of the fields " + ", ".join(hints) + did_you_mean(field, hints),
            )
    for field in dataclasses.fields(kind):
        needed = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        if needed and field.name not in value:
            raise SettingError(f"{kind.__name__}.{field.name}", "missing", "a value")
    return kind(
        **{field: _decoded(hints[field], given, f"{kind.__name__}.{field}") for field, given in value.items()}
    )


@lru_cache(maxsize=32)
def _hints(kind: type) -> dict[str, Any]:
    """Field name → its annotation, evaluated."""
    hints = typing.get_type_hints(kind)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind)}
