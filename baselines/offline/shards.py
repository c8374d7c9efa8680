"""Missions written as Parquet, some of them in each file, in row groups: memory holds one group at a time."""
# pyright: reportMissingImports=false

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from baselines.experiments.mission import Surroundings
from baselines.experiments.outcome import Outcome
from baselines.experiments.provenance import code_digest, modules_of
from baselines.offline.recorded_env import Row, record_mission, recorded_env
from baselines.offline.schema import schema_of
from entropy_explore_env.scenario import Scenario

GROUP_ROWS = 4096
"""Rows of a row group."""
_READERS = "entropy_explore_env.worlds.files"


@dataclass(frozen=True)
class Shard:
    """The missions of one file, as the runner takes them.

    Attributes:
        scenario: Of `observed_scenario`.
        strategy: Name of the strategy.
        surroundings: Worlds, starts and length of a step.
        first, missions: The seeds first, first + 1, …
        out: Folder of the files.
    """

    scenario: Scenario
    strategy: str
    surroundings: Surroundings
    first: int
    missions: int
    out: str

    @property
    def file(self) -> str:
        """Its record's name in the folder of records; its own in `out`, with the suffix .parquet."""
        return f"episodes-{self.first:09}"

    @property
    def path(self) -> Path:
        """Where it is written."""
        return Path(self.out) / f"{self.file}.parquet"

    @property
    def settings_digest(self) -> str:
        """Of all that decides the file's bytes but the code."""
        described = repr((self.scenario, self.strategy, self.surroundings, self.missions, pa.__version__))
        for file in self.surroundings.files():
            described += hashlib.sha256(file.read_bytes()).hexdigest()
        return hashlib.sha256(described.encode()).hexdigest()

    def code_digest(self) -> str:
        """Of the code that this process would run its missions with."""
        readers = modules_of(_READERS) if self.surroundings.files() else ()
        return code_digest(__name__, *readers, strategy=self.strategy)

    def run(self) -> Outcome:
        """Run the missions, and write the file whole or not at all."""
        env = recorded_env(self.scenario, self.surroundings)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        counts = {"missions": self.missions, "decisions": 0}
        try:
            with RowGroups(unfinished, schema_of(self.scenario, self.strategy)) as groups:
                for seed in range(self.first, self.first + self.missions):
                    counts["decisions"] += record_mission(env, self.strategy, seed, groups.add)
            unfinished.replace(self.path)
        finally:
            unfinished.unlink(missing_ok=True)
        return Outcome({**counts, "rows": groups.rows, "bytes": self.path.stat().st_size})


class RowGroups:
    """A Parquet file that grows by row groups.

    Attributes:
        rows: How many rows were added so far.
    """

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        """Begin the file."""
        self.rows = 0
        self._schema, self._group = schema, []
        self._writer = pq.ParquetWriter(path, schema, compression="zstd")

    def __enter__(self) -> RowGroups:
        return self

    def __exit__(self, *error: object) -> None:
        try:
            if self._group and error[0] is None:
                self._write()
        finally:
            self._writer.close()

    def add(self, row: Row) -> None:
        """Add a row; a group that is full is written."""
        self._group.append(row)
        self.rows += 1
        if len(self._group) == GROUP_ROWS:
            self._write()

    def _write(self) -> None:
        columns = [[row[field.name] for row in self._group] for field in self._schema]
        arrays = [pa.array(column, field.type) for column, field in zip(columns, self._schema, strict=True)]
        self._writer.write_batch(pa.record_batch(arrays, schema=self._schema), row_group_size=GROUP_ROWS)
        self._group.clear()
