"""From missions of a suite to rows: one of each strategy in each task, and one over all tasks.

A measure (path, time) of a mission that never came so far counts with its limit: the time limit, and the path
that the team could have driven in it. A ratio is that of paired missions, with the same world, start and
seed: of a task its geometric mean, over all tasks the geometric mean of the tasks', each task alike.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from baselines.experiments.outcome import Record
from baselines.experiments.runner import NOT_RUN
from baselines.experiments.statistics import Interval, geometric_ratio_interval, median_interval
from baselines.scoreboard.suites import Suite, Task

BASELINE = "random"
REFERENCE = "nearest-frontier"
"""The strategy that ratios are relative to; where it does not take part, the random walk is."""
SEEN = (50, 90, 95, 99, 100)
"""Per cent of what can be seen."""
BITS = (50, 90, 99)
"""Per cent of the bits that a mission asks for."""

_LEAST = 1e-3
"""Of any measure, in metres or seconds: ratios need numbers above 0."""

Row = dict[str, Any]


class Measure(NamedTuple):
    """What a mission is judged by; smaller is better.

    Attributes:
        figure: `time_s` or `path_m`.
        share: When that many per cent of what can be seen were seen, or the best map had lost that many per
            cent of the bits that the mission asks for; None = at the mission's end.
        of: `seen` or `bits`.
    """

    figure: str
    share: int | None = None
    of: str = "seen"

    @property
    def name(self) -> str:
        """Of its column in a table of numbers."""
        return f"{self.figure}_end" if self.share is None else f"{self.figure}_{self.share}_{self.of}"

    @property
    def words(self) -> str:
        """In the heads of tables."""
        what = "path (m)" if self.figure == "path_m" else "time (s)"
        return f"{what} to the end" if self.share is None else f"{what} to {self.share} % {self.of}"


PATH, TIME, TIME_99, TIME_90 = (
    Measure("path_m"),
    Measure("time_s"),
    Measure("time_s", 99),
    Measure("time_s", 90, "bits"),
)
JUDGED_BY = {
    "plans": (PATH, TIME_99),
    "volumes": (TIME, TIME_90),
    "teams": (TIME, TIME_90),
    "others": (TIME, TIME_90),
    "own": (TIME, TIME_90),
}
"""Suite → its two measures, the more important one first."""
MARKS = (
    *(Measure(figure, share) for figure in ("time_s", "path_m") for share in SEEN),
    *(Measure("time_s", share, "bits") for share in BITS),
)
"""What is told of every mission."""


@dataclass(frozen=True)
class Results:
    """A suite that was run.

    Not all of it needs to have been run: what is told of a strategy is of its missions so far, and a ratio of
    those that the reference has run, too.

    Attributes:
        suite: Its tasks and strategies.
        records: Cell id → records by seed: of `SuiteMission`, `failed_record` or NOT_RUN.
    """

    suite: Suite
    records: dict[str, list[Record]]

    @property
    def reference(self) -> str:
        """The strategy that ratios are relative to."""
        return REFERENCE if REFERENCE in self.suite.strategies else BASELINE

    @property
    def ran(self) -> tuple[str, ...]:
        """Strategies that ran a mission, as the suite orders them."""
        return tuple(
            who for who in self.suite.strategies if any(self.of(task, who) for task in self.suite.tasks)
        )

    @property
    def judged_by(self) -> tuple[Measure, ...]:
        """The suite's measures."""
        return JUDGED_BY[self.suite.name]

    def numbered(self, task: Task, strategy: str) -> dict[int, Record]:
        """Number of the mission → record, of those that were run; the same missions for every strategy."""
        records = [
            record
            for place in task.places
            for record in self.records[self.suite.cell_id(task, place, strategy)]
        ]
        return {number: record for number, record in enumerate(records) if record != NOT_RUN}

    def of(self, task: Task, strategy: str) -> list[Record]:
        """(N) records of the missions of a task that were run."""
        return list(self.numbered(task, strategy).values())

    def values(
        self, task: Task, strategy: str, measure: Measure, missions: Iterable[int] | None = None
    ) -> np.ndarray:
        """(N,) float64 a measure of each mission; its limit where the mission never came so far.

        Args:
            task: Where.
            strategy: Whose.
            measure: Which.
            missions: Numbers of missions that were run; None = all of these.
        """
        limit, records = limit_of(task, measure), self.numbered(task, strategy)
        found = [value(records[number], measure) for number in (records if missions is None else missions)]
        reached = np.asarray([limit if each is None else each for each in found], float)
        return np.maximum(reached, _LEAST)

    def ratio(
        self, strategy: str, reference: str, measure: Measure, tasks: Sequence[Task]
    ) -> Interval | None:
        """The ratio to a reference over those of some tasks in which both can act; None = in none."""
        both = (strategy, reference)
        acting = [task for task in tasks if not any(_cannot_act(self.of(task, who)) for who in both)]
        pairs = [(task, self.shared(task, both)) for task in acting]
        pairs = [(task, missions) for task, missions in pairs if missions]
        if not pairs:
            return None
        return geometric_ratio_interval(
            [self.values(task, strategy, measure, missions) for task, missions in pairs],
            [self.values(task, reference, measure, missions) for task, missions in pairs],
        )

    def shared(self, task: Task, strategies: Sequence[str]) -> list[int]:
        """Numbers of the missions of a task that all of some strategies ran."""
        first, *others = (self.numbered(task, strategy) for strategy in strategies)
        return [number for number in first if all(number in other for other in others)]


def limit_of(task: Task, measure: Measure) -> float:
    """What a mission counts with that never came so far."""
    limit_s = task.scenario.ending.time_limit_s
    if measure.figure == "time_s":
        return limit_s
    return (
        sum(task.scenario.kind_of(robot).robot.max_speed_m_s for robot in range(task.scenario.robots))
        * limit_s
    )


def value(record: Record, measure: Measure) -> float | None:
    """A measure of a mission; None = it never came so far, or failed."""
    if measure.share is None:
        if not record.get("finished", False):
            return None
        return record["joint"]["driven_m"] if measure.figure == "path_m" else record["t_mission_s"]
    if measure.of == "bits":
        return record.get(f"t{measure.share}_s")
    mark = f"path{measure.share}_seen_m" if measure.figure == "path_m" else f"t{measure.share}_seen_s"
    return record.get("joint", {}).get(mark)


def task_rows(results: Results) -> list[Row]:
    """A row of each task and strategy that ran a mission; ends of intervals as `…_low` and `…_high`."""
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
    for measure in results.judged_by:
        limit = limit_of(task, measure)
        row |= interval_columns(measure.name, median_interval(results.values(task, strategy, measure)))
        row[f"{measure.name}_limit"] = limit if math.isfinite(limit) else None
        ratio = results.ratio(strategy, results.reference, measure, [task])
        row |= interval_columns(f"{measure.name}_over_{results.reference}", ratio)
    for measure in MARKS:
        reached = [each for each in (value(record, measure) for record in records) if each is not None]
        name = f"median_{measure.name}"
        row[name] = float(np.median(reached)) if 2 * len(reached) > len(records) else None
    return row | _clock(records)


def _clock(records: Sequence[Record]) -> Row:
    """Milliseconds a decision: the median of the missions' medians, and the worst of all."""
    clocks = [record["clock"] for record in records if "clock" in record]
    return {
        "decision_ms": float(np.median([clock["decision_ms"] for clock in clocks])) if clocks else None,
        "worst_decision_ms": max((clock["worst_decision_ms"] for clock in clocks), default=None),
    }


def overall_rows(results: Results) -> list[Row]:
    """A row of each strategy that ran, over its tasks but those in which all of its missions failed."""
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
        for measure in results.judged_by:
            ratio = results.ratio(strategy, results.reference, measure, tasks)
            row |= interval_columns(f"{measure.name}_over_{results.reference}", ratio)
        rows.append(row | _clock(records))
    return rows


def _cannot_act(records: Sequence[Record]) -> bool:
    """Whether every mission of a task failed, or none was run."""
    return all("failed" in record for record in records)


_KEPT = ("world", "seed", "end_reason", "t_mission_s", "distance_m", "scans", "blocked_moves")


def mission_rows(results: Results) -> list[Row]:
    """A row of each mission."""
    rows = []
    for task in results.suite.tasks:
        for strategy in results.suite.strategies:
            for number, record in results.numbered(task, strategy).items():
                row: Row = {"task": task.name, "strategy": strategy, "mission": number}
                row |= {name: record.get(name) for name in _KEPT}
                row["end_reason"] = "FAILED" if "failed" in record else row["end_reason"]
                row |= {measure.name: value(record, measure) for measure in MARKS}
                rows.append(row)
    return rows


def failed_rows(results: Results) -> list[Row]:
    """Missions that failed: a row of each task, strategy and reason, with the numbers of the missions."""
    found: dict[tuple[str, str, str], list[int]] = {}
    for task in results.suite.tasks:
        for strategy in results.suite.strategies:
            for number, record in results.numbered(task, strategy).items():
                if "failed" in record:
                    found.setdefault((task.name, strategy, record["failed"]), []).append(number)
    names = ("task", "strategy", "reason")
    return [{**dict(zip(names, key, strict=True)), "missions": numbers} for key, numbers in found.items()]


def interval_columns(name: str, interval: Interval | None) -> Row:
    """A figure and the ends of its interval under names of their own."""
    middle, low, high = (None, None, None) if interval is None else interval
    return {name: middle, f"{name}_low": low, f"{name}_high": high}
