"""From a suite to its missions, and to rows: one of each strategy in each task, and one over all tasks.

A measure (path, time) of a mission that never came that far counts with its limit. A ratio is that of paired
missions, with the same world, start and seed: of a task its geometric mean, over all tasks the geometric mean
of the tasks', each task alike.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from baselines.experiments import rows as kept_rows
from baselines.experiments.rows import Record
from baselines.experiments.statistics import Interval, geometric_ratio_interval, median_interval
from baselines.experiments.trials import Cell, CellTrial, How, run_trials
from baselines.suites.public_worlds import fetch_worlds
from baselines.suites.suite import BASELINE, Measure, Records, Suite, Task
from entropy_explore_env.errors import MissingExtraError, SettingError

MARKS = (
    *(Measure(figure, share) for figure in ("time_s", "path_m") for share in (50, 90, 95, 99, 100)),
    *(Measure("time_s", share, "bits") for share in (50, 90, 99)),
)
"""What is told of every task beside the suite's measures."""
_TEAM = ("scans", "distance_m", "balance", "bits_sent")
"""Columns that are figures of the team."""
_JOINT = {"explored": "explored", "map_error": "error", "wrong": "wrong"}
"""Column → figure of the joint map."""
_LEAST = 1e-3
"""Least value of any measure: ratios need numbers above 0."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Results:
    """A suite that was run, or part of it.

    Attributes:
        suite: Its tasks and strategies.
        records: Of `SuiteMission`, or of missions that failed.
    """

    suite: Suite
    records: Records

    @property
    def reference(self) -> str:
        """The strategy to which ratios are relative."""
        suite = self.suite
        return suite.reference if suite.reference in suite.strategies else BASELINE

    @property
    def ran(self) -> tuple[str, ...]:
        """Strategies that ran a mission, as the suite orders them."""
        names, tasks = self.suite.strategies, self.suite.tasks
        return tuple(name for name in names if any(self.of(task, name) for task in tasks))

    @property
    def tasks(self) -> tuple[Task, ...]:
        """Tasks of which a mission was run."""
        names, tasks = self.suite.strategies, self.suite.tasks
        return tuple(task for task in tasks if any(self.of(task, name) for name in names))

    @property
    def broken(self) -> list[str]:
        """Strategies of which every mission raised an error, but for refusals of a scenario."""
        records = {name: [each for task in self.tasks for each in self.of(task, name)] for name in self.ran}
        return [name for name, own in records.items() if all(map(_raised, own))]

    def numbered(self, task: Task, strategy: str) -> dict[int, Record]:
        """Return mission number → record; the same mission has the same number for every strategy."""
        numbered: dict[int, Record] = {}
        before = 0
        for place in self.suite.places(task, strategy):
            records = self.records.get(self.suite.cell_id(task, place, strategy), {})
            numbered |= {before + seed: record for seed, record in records.items()}
            before += place.missions
        return numbered

    def of(self, task: Task, strategy: str) -> list[Record]:
        """Return (N) records of the missions of a task that were run."""
        return list(self.numbered(task, strategy).values())

    def values(
        self, task: Task, strategy: str, measure: Measure, missions: Iterable[int] | None = None
    ) -> np.ndarray:
        """Return (N,) float64 a measure of each mission; its limit where the mission never came that far.

        `missions` are numbers of missions that were run; None = all of them.
        """
        limit, records = measure.limit(task.scenario), self.numbered(task, strategy)
        found = [measure.value(records[number]) for number in (records if missions is None else missions)]
        reached = np.asarray([limit if each is None else each for each in found], float)
        return np.maximum(reached, _LEAST)

    def ratio(
        self, strategy: str, reference: str, measure: Measure, tasks: Sequence[Task]
    ) -> Interval | None:
        """Return the ratio to a reference over those of some tasks in which both can act; None = in none."""
        both = (strategy, reference)
        acting = [task for task in tasks if not any(_cannot_act(self.of(task, name)) for name in both)]
        pairs = [(task, missions) for task in acting if (missions := self.shared(task, both))]
        if not pairs:
            return None
        return geometric_ratio_interval(
            [self.values(task, strategy, measure, missions) for task, missions in pairs],
            [self.values(task, reference, measure, missions) for task, missions in pairs],
        )

    def ratio_alone(self, strategy: str, task: Task) -> float:
        """Return a task's ratio of the first measure without an interval; NaN where it says nothing."""
        both, measure = (strategy, self.reference), self.suite.measures[0]
        records = [record for name in both for record in self.of(task, name)]
        missions = self.shared(task, both)
        failed = any(_cannot_act(self.of(task, name)) for name in both)
        if not missions or failed or not any(record.get("finished", False) for record in records):
            return float("nan")
        ours, theirs = (self.values(task, name, measure, missions) for name in both)
        return float(np.exp(np.log(ours / theirs).mean()))

    def shared(self, task: Task, strategies: Sequence[str]) -> list[int]:
        """Return numbers of the missions of a task that all of some strategies ran."""
        first, *others = (self.numbered(task, strategy) for strategy in strategies)
        return [number for number in first if all(number in other for other in others)]


def run_suite(
    suite: Suite,
    table: Path,
    how: How,
    known: Sequence[kept_rows.Row] = (),
    trial_of: Callable[[Cell, int], CellTrial] = CellTrial,
) -> list[kept_rows.Row | None]:
    """Run what is missing of a suite, and of its later tasks; see `run_trials`.

    `trial_of` makes a trial of a cell and a seed.

    Returns:
        The row of each mission; None where the time was up.

    Raises:
        WorldError: A public world cannot be fetched: no mission is run.
    """
    began_s = time.monotonic()
    fetch_worlds(cell.scenario for cell in suite.cells)
    found = run_trials([trial_of(trial.point, trial.seed) for trial in suite.trials], table, how, known)
    if suite.later is None:
        return found
    first = {cell.id for cell in suite.cells}
    completed = suite.completed(by_seed(row for row in found if row is not None))
    later = [trial_of(each.point, each.seed) for each in completed.trials if each.cell not in first]
    left_s = max(how.stop_after_s - (time.monotonic() - began_s), 0.0)
    return found + run_trials(later, table, replace(how, stop_after_s=left_s), known)


def results_of(suite: Suite, rows: Sequence[kept_rows.Row]) -> tuple[Results, list[kept_rows.Row]]:
    """Return what missions came to, and their rows; those that are none of the suite's are passed over.

    Args:
        suite: Its strategies are shown first, then any others of the rows.
        rows: Of two of the same mission the later counts.
    """
    names = dict.fromkeys([*suite.strategies, *(str(row.settings.get("strategy")) for row in rows)])
    suite = replace(suite, strategies=tuple(names))
    kept = _rows_of(suite.cells, rows)
    if suite.later is not None:
        suite = suite.completed(by_seed(kept))
        kept = _rows_of(suite.cells, rows)
    return Results(suite, by_seed(kept)), kept


def by_seed(rows: Iterable[kept_rows.Row]) -> dict[str, dict[int, Record]]:
    """Return the records of each cell by seed."""
    records: dict[str, dict[int, Record]] = {}
    for row in rows:
        records.setdefault(row.cell, {})[row.seed] = row.record
    return records


def _rows_of(cells: Sequence[Cell], rows: Sequence[kept_rows.Row]) -> list[kept_rows.Row]:
    """Return the rows that are missions of some cells, sorted as tables are."""
    named = {cell.id: cell for cell in cells}
    asked: dict[str, Any] = {}
    found = {}
    for row in rows:
        if row.cell not in named or row.seed >= named[row.cell].seeds:
            continue
        if row.cell not in asked:
            asked[row.cell] = _settings_of(named[row.cell], row)
        if row.settings == asked[row.cell]:
            found[row.key] = row
    return [found[key] for key in sorted(found)]


def _settings_of(cell: Cell, row: kept_rows.Row) -> dict[str, Any]:
    """Return the settings of a cell; what a strategy that is not installed is made of is as the row says."""
    try:
        return CellTrial(cell, row.seed).settings
    except (SettingError, MissingExtraError):
        alike = CellTrial(replace(cell, strategy=BASELINE), row.seed).settings
        named = ("strategy", "strategy_files")
        return {**alike, **{name: row.settings[name] for name in named if name in row.settings}}


def overall_rows(results: Results) -> list[Row]:
    """Return a row of each strategy that ran, over its tasks but those in which all its missions failed."""
    rows = []
    for strategy in results.ran:
        tasks = [task for task in results.suite.tasks if not _cannot_act(results.of(task, strategy))]
        records = [record for task in tasks for record in results.of(task, strategy)]
        finished = sum(record.get("finished", False) for record in records)
        row: Row = {
            "strategy": strategy,
            "tasks": len(tasks),
            "missions": len(records),
            "finished": finished / len(records) if records else None,
        }
        row |= {
            f"{measure.name}_ratio": results.ratio(strategy, results.reference, measure, tasks)
            for measure in results.suite.measures
        }
        rows.append(row | _clock(records))
    first = f"{results.suite.measures[0].name}_ratio"
    return sorted(rows, key=lambda row: (row[first] is None, row[first]))


def task_rows(results: Results) -> list[Row]:
    """Return a row of each task and strategy that ran a mission."""
    return [
        _task_row(results, task, strategy)
        for task in results.suite.tasks
        for strategy in results.suite.strategies
        if results.of(task, strategy)
    ]


def _task_row(results: Results, task: Task, strategy: str) -> Row:
    records = results.of(task, strategy)
    row: Row = {
        "task": task.name,
        "strategy": strategy,
        "missions": len(records),
        "finished": sum(record.get("finished", False) for record in records),
        "failed": sum("failed" in record for record in records),
    }
    for measure in results.suite.measures:
        row[measure.name] = median_interval(results.values(task, strategy, measure))
        row[f"{measure.name}_limit"] = measure.limit(task.scenario)
        row[f"{measure.name}_ratio"] = results.ratio(strategy, results.reference, measure, [task])
    row |= {f"median_{mark.name}": _median(map(mark.value, records), len(records)) for mark in MARKS}
    row |= {name: _median((each.get(name) for each in records), 0) for name in _TEAM}
    joint = [record.get("joint", {}) for record in records]
    row |= {name: _median((each.get(figure) for each in joint), 0) for name, figure in _JOINT.items()}
    return row | _clock(records)


def _median(values: Iterable[float | None], of: int) -> float | None:
    """Return the median of the values that there are, if these are more than half of a number of missions."""
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known and 2 * len(known) > of else None


def _clock(records: Sequence[Record]) -> Row:
    """Return milliseconds a decision: the median of the missions' medians, and the worst of all."""
    clocks = [record["clock"] for record in records if "clock" in record]
    return {
        "decision_ms": float(np.median([clock["decision_ms"] for clock in clocks])) if clocks else None,
        "worst_decision_ms": max((clock["worst_decision_ms"] for clock in clocks), default=None),
    }


def failed_rows(results: Results) -> list[Row]:
    """Return missions that failed: a row of each task, strategy and reason, with the missions' numbers."""
    found: dict[tuple[str, str, str], list[int]] = {}
    for task in results.suite.tasks:
        for strategy in results.suite.strategies:
            for number, record in results.numbered(task, strategy).items():
                if "failed" in record:
                    found.setdefault((task.name, strategy, record["failed"]), []).append(number)
    names = ("task", "strategy", "reason")
    return [{**dict(zip(names, key, strict=True)), "missions": numbers} for key, numbers in found.items()]


def _cannot_act(records: Sequence[Record]) -> bool:
    """Return whether every mission of a task failed, or none was run."""
    return all("failed" in record for record in records)


def _raised(record: Record) -> bool:
    """Return whether a mission raised an error that is no refusal of its scenario."""
    said = record.get("failed", "")
    return bool(said) and not said.startswith(("SettingError", "WorldError", "ran past"))
