"""Settings as JSON and back, without loss: every number exact, infinity as the text "inf"."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np

from entropy_explore_env.errors import SettingError, did_you_mean
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import annotations_of

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
    annotations = annotations_of(kind)
    if not isinstance(settings, Mapping):
        raise SettingError(name, settings, f"an object with the fields of {kind.__name__}")
    for field, given in settings.items():
        if field not in annotations:
            raise SettingError(
                f"{kind.__name__}.{field}",
                given,
                "one of the fields " + ", ".join(annotations) + did_you_mean(field, annotations),
            )
    for each in dataclasses.fields(kind):  # type: ignore[arg-type]
        needed = each.default is dataclasses.MISSING and each.default_factory is dataclasses.MISSING
        if needed and each.name not in settings:
            raise SettingError(f"{kind.__name__}.{each.name}", "missing", "a value")
    return kind(
        **{
            field: _decoded(annotations[field], given, f"{kind.__name__}.{field}")
            for field, given in settings.items()
        }
    )


def _decoded(annotation: Any, value: Any, name: str) -> Any:  # noqa: ANN401 - whatever a setting may be
    """Return the value of a setting with an annotation; the settings check themselves what it is."""
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return _decoded(_member(annotation, value), value, name)
    if dataclasses.is_dataclass(annotation):
        return dataclass_of(typing.cast(type, annotation), value, name)
    if typing.get_origin(annotation) is tuple and isinstance(value, list):
        kinds = typing.get_args(annotation)
        repeated = len(kinds) == 2 and kinds[1] is Ellipsis
        if not repeated and len(kinds) != len(value):
            raise SettingError(name, value, f"a list of {len(kinds)}")
        return tuple(
            _decoded(kinds[0] if repeated else kinds[place], each, f"{name}[{place}]")
            for place, each in enumerate(value)
        )
    return math.inf if annotation is float and value == INFINITY else value


def _member(union: Any, value: Any) -> Any:  # noqa: ANN401 - an annotation
    """Return the member of a union of which the value is; None where it needs no decoding."""
    members = typing.get_args(union)
    for member in members:
        if dataclasses.is_dataclass(member) and isinstance(value, Mapping):
            return member
        if typing.get_origin(member) is tuple and isinstance(value, list):
            return member
    return float if value == INFINITY and float in members else None
