"""Experiments as cells of missions, run in processes, resumable.

A cell is a scenario with a strategy; its missions differ by seed. Every mission leaves one small
file, written whole or not at all, so that an experiment goes on where it was stopped.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, is_dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TypeVar

from baselines.experiments import mission
from baselines.experiments.mission import Record, mission_record, scripted
from baselines.experiments.provenance import sources_digest
from baselines.experiments.worker_pool import Failure, run_each
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.writing import write_atomically

_PACE_PERIOD_S = 600.0
"""The bar's time left is reckoned from so much of the past: single missions differ a lot."""
_LONGEST_REASON = 200
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
"""Where an object lies: another place in every process."""

Item = TypeVar("Item")


@dataclass(frozen=True)
class Cell:
    """One point of an experiment.

    Attributes:
        id: Its name, also that of its folder; slashes make folders in folders.
        scenario: The task.
        strategy: Name of the strategy.
        seeds: Number of missions; their seeds are 0, 1, …, the same in every cell (paired).
        record: Runs a mission with a strategy and a seed, and says what is kept of it.
    """

    id: str
    scenario: Scenario
    strategy: str
    seeds: int
    record: Callable[[EntropyExploreEnv, str, int], Record] = mission_record

    @cached_property
    def digest(self) -> str:
        """Of all that decides the results; worked out once, since it reads sources and world files."""
        parts = _parts(self.record)
        made_by = {type(part).__module__ for part in parts if is_dataclass(part)} | {self.record.__module__}
        described = repr(
            (
                sources_digest(self.strategy, mission.__name__, *sorted(made_by)),
                scripted(self.scenario),
                self.strategy,
                self.record if is_dataclass(self.record) else None,  # it has settings of its own
            )
        )
        for file in (self.scenario.world, *(part for part in parts if isinstance(part, str))):
            if Path(file).is_file():
                described += hashlib.sha256(Path(file).read_bytes()).hexdigest()
        return hashlib.sha256(described.encode()).hexdigest()[:16]


def _parts(record: object) -> list[object]:
    """A value, and where it is a dataclass the values of its fields, and of theirs."""
    fields = vars(record).values() if is_dataclass(record) else ()
    return [record, *(part for value in fields for part in _parts(value))]


def run_cells(
    cells: Sequence[Cell],
    folder: Path,
    jobs: int,
    title: str,
    quiet: bool,
    limit_s: float = math.inf,
    keep_failures: bool = False,
) -> dict[str, list[Record]]:
    """Run what is missing of an experiment, under a progress bar.

    Args:
        cells: The points.
        folder: For one file a mission.
        jobs: Processes; with one, missions run in this process.
        title: Of the progress bar.
        quiet: Show no bar.
        limit_s: Of every mission, on the clock; see `workers.run_each`.
        keep_failures: A mission that fails leaves the record of `failed_record`; else its error is raised.

    Returns:
        Cell id → records by seed; see `mission_record` for what one holds.
    """
    records: dict[str, dict[int, Record]] = {cell.id: {} for cell in cells}
    todo: list[tuple[Cell, int]] = []
    # all cells grow together: so the bar's time left means something from the first round on
    for seed in range(max((cell.seeds for cell in cells), default=0)):
        for cell in cells:
            record = _read(folder, cell, seed, limit_s) if seed < cell.seeds else None
            if record is not None:
                records[cell.id][seed] = record
            elif seed < cell.seeds:
                todo.append((cell, seed))
    done = sum(len(found) for found in records.values())
    results = run_each(_run_one, todo, jobs, limit_s)
    for (cell, seed), outcome in _progressing(results, done, done + len(todo), title, quiet):
        if isinstance(outcome, Failure):
            if not keep_failures:
                outcome.throw()
            record = failed_record(outcome, limit_s)
        else:
            record = outcome
        _write(folder, cell, seed, record)
        records[cell.id][seed] = record
    return {cell.id: [records[cell.id][seed] for seed in range(cell.seeds)] for cell in cells}


def _progressing(results: Iterator[Item], done: int, total: int, title: str, quiet: bool) -> Iterator[Item]:
    """Pass results on under a progress bar on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(file=sys.stderr)
    with Progress(*columns, console=console, disable=quiet, speed_estimate_period=_PACE_PERIOD_S) as progress:
        task = progress.add_task(title, total=total, completed=done)
        for result in results:
            progress.advance(task)
            yield result


def _run_one(task: tuple[Cell, int]) -> Record:
    """Run a mission of a cell in this process."""
    cell, seed = task
    try:
        return cell.record(_environment(scripted(cell.scenario)), cell.strategy, seed)
    except BaseException:
        _environment.cache_clear()  # it stopped in the middle of something
        raise


@lru_cache(maxsize=1)
def _environment(scenario: Scenario) -> EntropyExploreEnv:
    """Kept for the next mission."""
    return EntropyExploreEnv(scenario)


def failed_record(failure: Failure, limit_s: float) -> Record:
    """What is kept of a mission that failed.

    Returns:
        `failed`, the reason; `trace`, where it was; and `limit_s` of a mission that ran past it, which a
        longer limit runs again.
    """
    reason = _ADDRESS.sub(" at 0x…", failure.reason)
    reason = reason if len(reason) <= _LONGEST_REASON else reason[:_LONGEST_REASON] + " …"
    return {"failed": reason, "trace": failure.trace, "limit_s": limit_s if failure.late else None}


def _path(folder: Path, cell: Cell, seed: int) -> Path:
    return folder / cell.id.replace("..", "__") / f"seed-{seed}.json"  # a strategy may be named by a path


def _write(folder: Path, cell: Cell, seed: int, record: Record) -> None:
    content = {"digest": cell.digest, "checksum": _checksum(record), "record": record}
    write_atomically(_path(folder, cell, seed), json.dumps(content, allow_nan=False))


def _checksum(record: object) -> str:
    """Of a record, so that one that was changed by hand is run again."""
    return hashlib.sha256(json.dumps(record).encode()).hexdigest()[:16]


def _read(folder: Path, cell: Cell, seed: int, limit_s: float = math.inf) -> Record | None:
    """A mission's record if it was run with the same settings before, and not ended by a shorter limit."""
    try:
        content = json.loads(_path(folder, cell, seed).read_text())
    except (OSError, ValueError):
        return None
    if not isinstance(content, dict) or content.get("digest") != cell.digest:
        return None
    record = content.get("record")
    if not isinstance(record, dict) or content.get("checksum") != _checksum(record):
        return None
    ended_after_s = record.get("limit_s")
    return None if ended_after_s is not None and ended_after_s < limit_s else record
