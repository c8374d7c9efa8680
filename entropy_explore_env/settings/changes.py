"""Scenarios with some settings changed."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from entropy_explore_env.errors import SettingError, did_you_mean
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import check_instance

Settings = TypeVar("Settings")

_SHORT = ("max_cycles", "time_limit_s")
"""Fields of the ending that `with_settings` takes as the scenario's own."""


def with_settings(scenario: Scenario, settings: Mapping[str, Any]) -> Scenario:
    """Return a copy of the scenario with some settings changed.

    Args:
        scenario: What to start from.
        settings: Field name → value. A part (`channel`, `robot`, …) takes either an object of its
            class or a mapping of its own fields: `{"channel": {"burst": 32}}`. `max_cycles` and
            `time_limit_s` are short for the fields of `ending`.

    Raises:
        SettingError: A name is unknown or a value is not allowed.
    """
    check_instance("scenario", scenario, Scenario)
    if not isinstance(settings, Mapping):
        raise SettingError("settings", settings, "a mapping from names of settings to values")
    changes = _named(scenario, settings)
    for name in _SHORT:
        if name in changes:
            ending = changes.get("ending", {})
            shortcut = {name: changes.pop(name)}
            if not isinstance(ending, Mapping | Ending):
                raise SettingError("Scenario.ending", ending, "an Ending, or a mapping of its fields")
            merged = {**ending, **shortcut} if isinstance(ending, Mapping) else _replaced(ending, shortcut)
            changes["ending"] = merged
    return _replaced(scenario, changes)


def _meant(settings: object, name: str, value: object, known: Sequence[str]) -> str:
    """Return the end of the message about an unknown field: a part that has such a field, or one like it.

    A mapping is meant for a part, any other value for a field that is not a part.
    """
    parts = [each for each in known if dataclasses.is_dataclass(getattr(settings, each, None))]
    inner = [(part, each.name) for part in parts for each in dataclasses.fields(getattr(settings, part))]
    found = [(part, field) for part, field in inner if field == name]
    if not any(each.startswith(f"{name}_") for each in known):
        found += [(part, field) for part, field in inner if field.startswith(f"{name}_")]
    if found:
        part, field = found[0]
        return f"; did you mean {part}={{{field!r}: …}}?"
    alike = parts if isinstance(value, Mapping) else [each for each in known if each not in parts]
    return did_you_mean(name, alike)


def _named(settings: object, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the changes as a dict, if all of their names are texts."""
    pairs = list(changes.items())
    for name, value in pairs:
        if not isinstance(name, str):
            given = f"{type(settings).__name__}, field {name!r:.100}"
            raise SettingError(given, value, "a text as the field's name")
    return dict(pairs)


def _replaced(settings: Settings, changes: Mapping[str, Any]) -> Settings:
    """Replace fields as dataclasses.replace does, into nested parts; an unknown one gives a named error."""
    changes = _named(settings, changes)
    fields = [f.name for f in dataclasses.fields(settings)]  # type: ignore[arg-type]
    known = [*fields, *(_SHORT if isinstance(settings, Scenario) else ())]
    values: dict[str, Any] = {}
    for name, value in changes.items():
        if name not in fields:
            raise SettingError(
                f"{type(settings).__name__}.{name}",
                value,
                "one of the fields " + ", ".join(fields) + _meant(settings, name, value, known),
            )
        current = getattr(settings, name)
        nested = isinstance(value, Mapping) and dataclasses.is_dataclass(current)
        values[name] = _replaced(current, value) if nested else value
    return dataclasses.replace(settings, **values)  # type: ignore[type-var]
