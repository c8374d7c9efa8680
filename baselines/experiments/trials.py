"""Experiments as trials: what is missing of them is run, row by row, and what was stopped goes on.

A trial says what decides its record; the code is not part of that. A row of the same settings stands for
the trial whatever code made it, unless it is to be run again.
"""

from __future__ import annotations

import csv
import dataclasses
import enum
import hashlib
import importlib.util
import math
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from baselines import strategies
from baselines.experiments.mission import Surroundings, mission_record, scripted, scripted_env
from baselines.experiments.origin import commits_since, this_origin
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.rows import GrowingTable, Record, Row, trial_key
from baselines.experiments.worker_pool import Failure, run_each
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.reward import Reward
from entropy_explore_env.settings.scenario import Scenario

_PACE_PERIOD_S = 600.0
"""The bar estimates the time left from this much of the past: single missions differ a lot."""
_LONGEST_REASON = 200
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
"""Where an object lies: another place in every process."""

Item = TypeVar("Item")


class Trial(Protocol):
    """A piece of an experiment; it can be pickled."""

    @property
    def cell(self) -> str:
        """Name of the point of the experiment."""
        ...

    @property
    def seed(self) -> int:
        """Its seed."""
        ...

    @property
    def world(self) -> str:
        """Name of its world or file."""
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides its record, but the code and the seed; JSON."""
        ...

    def run(self) -> Record:
        """Run it in this process."""
        ...


@dataclass(frozen=True)
class How:
    """How trials are run.

    Attributes:
        workers: Processes of this machine, or a Ray cluster; with one process they are run in this one.
        title: Of the progress bar.
        quiet: Show no bar.
        limit_s: Of every trial, on the clock; see `worker_pool.run_each`.
        keep_failures: A trial that fails leaves the record of `failed_record`; else its error is raised.
        stop_after_s: After this time on the clock no more trial is begun.
        rerun: Run all of them, whatever is in the table.
        since: Run those again whose row is of a commit before this one.
    """

    workers: int | RayCluster = 1
    title: str = ""
    quiet: bool = True
    limit_s: float = math.inf
    keep_failures: bool = False
    stop_after_s: float = math.inf
    rerun: bool = False
    since: str | None = None

    def __post_init__(self) -> None:
        """Check what contradicts itself."""
        if self.rerun and self.since is not None:
            raise SettingError("since", self.since, "no value beside --rerun, which runs all again")


def run_trials(trials: Sequence[Trial], table: Path, how: How, known: Sequence[Row] = ()) -> list[Row | None]:
    """Run what is missing of some trials, and add it to their table.

    Args:
        trials: In the order in which they are begun.
        table: The file of rows; it may hold other trials, too, which stay.
        how: Where and how long.
        known: Rows from elsewhere, such as an archive: they stand for their trials, and are added.

    Returns:
        The row of each, in the same order; None where the time was up.

    Raises:
        SettingError: Two trials are the same, the table cannot be used, or there is no such commit.
    """
    keys = [trial_key(trial.cell, trial.seed, trial.settings) for trial in trials]
    if len(set(keys)) < len(keys):
        twice = next(trial for trial, key in zip(trials, keys, strict=True) if keys.count(key) > 1)
        raise SettingError("cell", f"{twice.cell}, seed {twice.seed}", "one trial of these settings")
    counted = None if how.since is None else commits_since(how.since)
    grown = GrowingTable(table)
    with grown.opened() as kept:
        rows = {row.key: row for row in kept}
        asked = set(keys)
        given = {row.key: row for row in known if row.key in asked and row.key not in rows}
        if given:
            grown.append(*given.values())
            rows |= given
        wanted = [
            (key, trial)
            for key, trial in zip(keys, trials, strict=True)
            if how.rerun or key not in rows or not _counts(rows[key], counted, how.limit_s)
        ]
        again = {key for key, _ in wanted}
        done = {key: rows[key] for key in keys if key in rows and key not in again}
        for trial, record in _records([trial for _, trial in wanted], len(done), how):
            row = Row(trial.cell, trial.seed, trial.world, trial.settings, this_origin(), record)
            grown.append(row)
            done[row.key] = row
        grown.finish()
    return [done.get(key) for key in keys]


def _counts(row: Row, commits: frozenset[str] | None, limit_s: float) -> bool:
    """Return whether a row stands for its trial: it is recent enough, and no shorter limit ended it."""
    ended_after_s = row.record.get("limit_s")
    if ended_after_s is not None and ended_after_s < limit_s:
        return False
    return commits is None or row.origin.commit in commits


def _records(trials: Sequence[Trial], done: int, how: How) -> Iterator[tuple[Trial, Record]]:
    """Yield trials and their records as they come, under a progress bar on standard error."""
    ends_s = time.monotonic() + how.stop_after_s
    this_origin()  # of the tree as it is before the first trial
    results = run_each(_run, trials if how.stop_after_s > 0.0 else [], how.workers, how.limit_s)
    for trial, result in _progressing(results, done, done + len(trials), how):
        if isinstance(result, Failure):
            if not how.keep_failures:
                result.throw()
            yield trial, failed_record(result, how.limit_s)
        else:
            yield trial, result
        if time.monotonic() > ends_s:
            results.close()
            return


def _run(trial: Trial) -> Record:
    return trial.run()


def _progressing(results: Iterator[Item], done: int, total: int, how: How) -> Iterator[Item]:
    """Pass results on under a progress bar on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(file=sys.stderr)
    with Progress(*columns, console=console, disable=how.quiet, speed_estimate_period=_PACE_PERIOD_S) as bar:
        task = bar.add_task(how.title, total=total, completed=done)
        for result in results:
            bar.advance(task)
            yield result


FAILED = frozenset({"failed", "trace", "limit_s"})
"""Keys of a failed trial's record."""


def failed_record(failure: Failure, limit_s: float) -> Record:
    """Return what is kept of a trial that failed.

    Returns:
        `failed`, the reason; `trace`, where it was; and `limit_s` of a trial that ran past it, which a longer
        limit runs again.
    """
    reason = _ADDRESS.sub(" at 0x…", failure.reason)
    reason = reason if len(reason) <= _LONGEST_REASON else reason[:_LONGEST_REASON] + " …"
    return {"failed": reason, "trace": failure.trace, "limit_s": limit_s if failure.late else None}


@dataclass(frozen=True)
class Cell:
    """One point of an experiment: a scenario with a strategy; its missions differ by seed.

    Attributes:
        id: Its name.
        scenario: The task.
        strategy: Name of the strategy.
        seeds: Number of missions; their seeds are 0, 1, …, the same in every cell (paired).
        record: Runs a mission with a strategy and a seed, and says what is kept of it: a function at the top
            of a module, or a frozen dataclass that can be called.
        surroundings: World files, starts and length of a step; None = those that the scenario says.
    """

    id: str
    scenario: Scenario
    strategy: str
    seeds: int
    record: Callable[[EntropyExploreEnv, str, int], Record] = mission_record
    surroundings: Surroundings | None = None


@dataclass(frozen=True)
class CellTrial:
    """One mission of a cell."""

    point: Cell
    seed: int

    @property
    def cell(self) -> str:
        """The cell's name."""
        return self.point.id

    @property
    def world(self) -> str:
        """The scenario's world, or the names of the world files."""
        files = self.point.surroundings.files() if self.point.surroundings else []
        return ", ".join(file.name for file in files) or Path(self.point.scenario.world).name

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides a mission of the cell."""
        return _cell_settings(self.point)

    def run(self) -> Record:
        """Run the mission in this process."""
        try:
            return self.play(environment(self.point.scenario, self.point.surroundings))
        except BaseException:
            environment.cache_clear()  # it stopped in the middle of something
            raise

    def play(self, env: EntropyExploreEnv) -> Record:
        """Run the mission in an environment."""
        return self.point.record(env, self.point.strategy, self.seed)


@lru_cache(maxsize=1)
def environment(scenario: Scenario, surroundings: Surroundings | None) -> EntropyExploreEnv:
    """Return an environment, kept for the next mission."""
    return scripted_env(scenario, surroundings)


@lru_cache(maxsize=4096)
def _cell_settings(cell: Cell) -> dict[str, Any]:
    """Return what decides the missions of a cell; rewards change no scripted mission."""
    settings: dict[str, Any] = {
        "scenario": described_scenario(cell),
        "strategy": strategies.resolved(cell.strategy),
        "record": described(cell.record),
    }
    if cell.surroundings is not None:
        settings["surroundings"] = described(cell.surroundings.without_folders())
        settings["files"] = [_file_digest(file) for file in cell.surroundings.files() if file.suffix]
    if outside := _strategy_files(cell.strategy):
        settings["strategy_files"] = [_file_digest(file) for file in outside]
    return settings


def described_scenario(cell: Cell) -> dict[str, Any]:
    """Return the scenario of a cell as rows hold it."""
    found = described(dataclasses.replace(scripted(cell.scenario), reward=Reward()))
    if cell.scenario.world in (former := _former_files()):
        found["world"] = former[cell.scenario.world]
    return found


@lru_cache(maxsize=1)
def _former_files() -> dict[str, list[str]]:
    """Return, by public world, name and digest of its former file, which rows hold in place of its name."""
    with Path(__file__).with_name("row_worlds.csv").open(newline="") as table:
        return {row["world"]: [row["file"], row["digest"]] for row in csv.DictReader(table)}


def described(value: Any) -> Any:  # noqa: ANN401 - whatever a setting may be
    """Return a setting as JSON: of dataclasses what differs from their defaults, of files their content."""
    if is_dataclass(value) and not isinstance(value, type):
        changed = {each.name: getattr(value, each.name) for each in dataclasses.fields(value)}
        for each in dataclasses.fields(value):
            usual = each.default if each.default_factory is dataclasses.MISSING else each.default_factory()
            if changed[each.name] == usual:
                del changed[each.name]
        return {"kind": type(value).__name__, **{name: described(each) for name, each in changed.items()}}
    if isinstance(value, Mapping):
        return {str(name): described(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [described(each) for each in value]
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, float) and math.isinf(value):
        return "inf"
    if isinstance(value, Path) or (isinstance(value, str) and "." in value and Path(value).is_file()):
        return [Path(value).name, _file_digest(Path(value))]
    return value.__qualname__ if callable(value) else value


@lru_cache(maxsize=1024)
def _file_digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def _strategy_files(name: str) -> list[Path]:
    """Return the files of a strategy that no commit of this repository says: weights, modules of others.

    Raises:
        SettingError: Its file or module is not there.
    """
    if strategies.is_learned(name):
        return strategies.learned_policies().policy_files(name)
    if Path(name).is_file():
        return [Path(name)]  # weights of the planner
    source = strategies.strategy_module(name)
    if isinstance(source, str) and source.split(".")[0] in ("baselines", "entropy_explore_env", "training"):
        return []
    file = source if isinstance(source, Path) else _file_of_module(source)
    if file is None or not file.is_file():
        raise SettingError("strategy", name, "a strategy whose file or module is there")
    return [file]


def _file_of_module(name: str) -> Path | None:
    """Return the file that a module is read from, or None where it has none."""
    try:
        spec = importlib.util.find_spec(name)
    except ModuleNotFoundError:
        return None
    return None if spec is None or spec.origin is None else Path(spec.origin)


def trials_of(cells: Sequence[Cell]) -> list[CellTrial]:
    """Return all missions of some cells, seed by seed: what was stopped has as many of each cell."""
    trials = [CellTrial(cell, seed) for cell in cells for seed in range(cell.seeds)]
    return sorted(trials, key=lambda trial: trial.seed)


def run_cells(cells: Sequence[Cell], table: Path, how: How) -> list[Row]:
    """Run what is missing of some cells.

    Returns:
        Their rows; see `run_trials`.
    """
    return [row for row in run_trials(trials_of(cells), table, how) if row is not None]


def by_cell(rows: Sequence[Row]) -> dict[str, list[Record]]:
    """Return the records of each cell, by seed."""
    found: dict[str, list[Record]] = {}
    for row in sorted(rows, key=lambda row: row.seed):
        found.setdefault(row.cell, []).append(row.record)
    return found
