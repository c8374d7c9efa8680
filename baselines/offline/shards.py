"""Missions written as Parquet, in each file a row group a mission: memory holds one mission at a time.

docs/episodes.md says for readers of the files what is in each column.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from baselines.experiments import rows as kept_rows
from baselines.experiments.mission import Surroundings
from baselines.experiments.rows import Record, trial_key
from baselines.experiments.trials import Cell, CellTrial, described
from baselines.offline.recorded_env import Row, record_mission, recorded_env
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.observation.layout import ObservationLayout
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.settings.scenario import Scenario

FORMAT = 1
"""Of the table, in the files' metadata."""
METADATA = b"entropy_explore_env"
"""Key of the files' metadata: JSON with format, scenario, strategy, and where parts of observations lie."""


def columns(scenario: Scenario) -> list[tuple[str, pa.DataType]]:
    """Return the names and types of the columns, where observations are flat."""
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
    """Return the schema of a file, with its metadata, where observations are flat."""
    parts = ObservationLayout(scenario).parts
    described: dict[str, Any] = {
        "format": FORMAT,
        "strategy": strategy,
        "parts": {name: [part.start, part.stop, *part.shape] for name, part in parts.items()},
        "scenario": settings_of(scenario),
    }
    fields = [pa.field(name, kind) for name, kind in columns(scenario)]
    return pa.schema(fields, metadata={METADATA: json.dumps(described, allow_nan=False).encode()})


def file_of(folder: Path, seed: int) -> Path:
    """Return the file of missions from a seed on."""
    return folder / f"episodes-{seed:09}.parquet"


@dataclass(frozen=True)
class Shard:
    """The missions of one file, as a trial of an experiment.

    Attributes:
        scenario: Of `observed_scenario`.
        strategy: Name of the strategy.
        surroundings: Worlds, starts and length of a step.
        seed, missions: The missions have the seeds seed, seed + 1, …
        out: Folder of the files.
    """

    scenario: Scenario
    strategy: str
    surroundings: Surroundings
    seed: int
    missions: int
    out: str
    cell = "episodes"

    @property
    def path(self) -> Path:
        """Where it is written."""
        return file_of(Path(self.out), self.seed)

    @property
    def world(self) -> str:
        """The scenario's world, or the names of the world files."""
        return self._mission.world

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides the file's bytes but the code."""
        seen = described(self.scenario.observation)
        return {
            **self._mission.settings,
            "observation": seen,
            "missions": self.missions,
            "pyarrow": pa.__version__,
        }

    @property
    def key(self) -> str:
        """What tells its row apart in a table."""
        return trial_key(self.cell, self.seed, self.settings)

    @property
    def _mission(self) -> CellTrial:
        """The first mission without observations."""
        cell = Cell(self.cell, self.scenario, self.strategy, self.missions, surroundings=self.surroundings)
        return CellTrial(cell, self.seed)

    def is_whole(self, record: Record) -> bool:
        """Return whether the file is there, as long as its record says."""
        return self.path.is_file() and self.path.stat().st_size == record.get("bytes")

    def run(self) -> Record:
        """Run the missions, and write the file whole or not at all."""
        env = recorded_env(self.scenario, self.surroundings)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        counts = {"missions": self.missions, "decisions": 0, "rows": 0}
        schema = schema_of(self.scenario, self.strategy)
        try:
            with pq.ParquetWriter(unfinished, schema, compression="zstd") as writer:
                for seed in range(self.seed, self.seed + self.missions):
                    rows: list[Row] = []
                    counts["decisions"] += record_mission(env, self.strategy, seed, rows.append)
                    counts["rows"] += len(rows)
                    writer.write_table(pa.Table.from_pylist(rows, schema))
            unfinished.replace(self.path)
        finally:
            unfinished.unlink(missing_ok=True)
        return {**counts, "bytes": self.path.stat().st_size}


def refuse_others(shards: Sequence[Shard], rows: Iterable[kept_rows.Row]) -> None:
    """Refuse a folder that would hold the same missions in two files, or others beside these.

    Args:
        shards: All that a command writes.
        rows: Of the folder's table.

    Raises:
        SettingError: The folder has such a file beside those of the command.
    """
    ours, first, last = {shard.path for shard in shards}, shards[0].seed, shards[-1]
    for row in rows:
        file, missions = file_of(Path(shards[0].out), row.seed), row.settings.get("missions")
        if file in ours or not file.is_file() or file.stat().st_size != row.record.get("bytes"):
            continue  # written again, removed, or written again before
        apart = row.seed >= last.seed + last.missions or row.seed + (missions or 0) <= first
        if not apart or _alike(row.settings) != _alike(shards[0].settings):
            allowed = f"a folder without {file.name}, which holds these missions in another form, or others"
            raise SettingError("out", shards[0].out, allowed)


def _alike(settings: dict[str, Any]) -> dict[str, Any]:
    """Return what files of one dataset have in common."""
    return {name: value for name, value in settings.items() if name not in ("missions", "pyarrow")}
