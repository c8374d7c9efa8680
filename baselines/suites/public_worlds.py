"""Scenarios in public worlds, which need the worlds' files only when missions are run."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.worlds.public.fetching import public_file
from entropy_explore_env.worlds.public.table import PUBLIC


def in_world(scenario: Scenario, name: str, settings: Mapping[str, Any] | None = None) -> Scenario:
    """Return a scenario in a public world as its table reads it, under its name and with settings changed."""
    there = dataclasses.replace(scenario, name=name, world=name, grid=PUBLIC[name].grid)
    return with_settings(there, settings or {})


def fetch_worlds(scenarios: Iterable[Scenario]) -> None:
    """Fetch the files of the public worlds of some scenarios, unless this machine has them.

    Raises:
        WorldError: A world cannot be fetched.
        MissingExtraError: The package that fetches is not installed.
    """
    for name in dict.fromkeys(scenario.world for scenario in scenarios):
        if name in PUBLIC:
            public_file(name)
