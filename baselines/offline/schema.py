"""The table of episodes: a row for each robot and step, with what is in each column.

docs/episodes.md says it for readers of the files.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

import json
from typing import Any

import pyarrow as pa

from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.observation.layout import ObservationLayout
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.settings.scenario import Scenario

FORMAT = 1
"""Of the table, in the files' metadata."""
METADATA = b"entropy_explore_env"
"""Key of the files' metadata: JSON with format, scenario, strategy, and where parts of observations lie."""


def columns(scenario: Scenario) -> list[tuple[str, pa.DataType]]:
    """Names and types of the columns.

    Args:
        scenario: With flat observations.
    """
    discrete = not action_space(scenario).shape
    return [
        ("mission", pa.int64()),
        ("step", pa.int32()),
        ("robot", pa.int16()),
        ("time_s", pa.float64()),
        ("decided", pa.bool_()),
        ("observation", pa.list_(pa.float32())),
        ("action", pa.int64() if discrete else pa.list_(pa.float32())),
        ("reward", pa.float64()),
        ("seconds", pa.float64()),
        ("terminated", pa.bool_()),
        ("truncated", pa.bool_()),
    ]


def schema_of(scenario: Scenario, strategy: str) -> pa.Schema:
    """Return the schema of a file, with its metadata.

    Args:
        scenario: With flat observations.
        strategy: Its name.
    """
    parts = ObservationLayout(scenario).parts
    described: dict[str, Any] = {
        "format": FORMAT,
        "strategy": strategy,
        "parts": {name: [part.start, part.stop, *part.shape] for name, part in parts.items()},
        "scenario": settings_of(scenario),
    }
    fields = [pa.field(name, kind) for name, kind in columns(scenario)]
    return pa.schema(fields, metadata={METADATA: json.dumps(described, allow_nan=False).encode()})
