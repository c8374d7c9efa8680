"""What more robots and worse channels change: the same strategy in tasks that differ by one of them.

Missions are paired by their number: the same world, and starts drawn from the same seed. A speed-up is the
geometric mean of the times of one robot over those of the team, where the channel differs of the times over
those with one that carries everything. Missions that were cut off count with the time limit: where that was
on one side alone, the figure is a bound.
"""

from __future__ import annotations

from baselines.experiments.statistics import Interval, geometric_ratio_interval
from baselines.experiments.tables import markdown_table
from baselines.scoreboard.results import Results, Row, interval_columns
from baselines.scoreboard.suites import Task


def effect_rows(results: Results) -> list[Row]:
    """A row of each strategy and task that is compared with another task, where missions of both were run."""
    named = {task.name: task for task in results.suite.tasks}
    return [
        row
        for task in results.suite.tasks
        if task.beside is not None and task.beside in named
        for strategy in results.suite.strategies
        if (row := _row(results, task, named[task.beside], strategy)) is not None
    ]


def _row(results: Results, task: Task, beside: Task, strategy: str) -> Row | None:
    """None where no mission was run in both."""
    measure = results.judged_by[0]
    here, there = (results.numbered(each, strategy) for each in (task, beside))
    both = [number for number in here if number in there]
    if not both:
        return None
    times = [results.values(each, strategy, measure, both) for each in (task, beside)]
    row = {"task": task.name, "beside": beside.name, "strategy": strategy, "missions": len(both)}
    for name, records in (("finished", here), ("beside_finished", there)):
        row[name] = sum(records[number].get("finished", False) for number in both)
    return row | interval_columns("time_over", geometric_ratio_interval([times[0]], [times[1]]))


def effects_table(results: Results, rows: list[Row]) -> str:
    """A row of each scenario and strategy, with a column of each team size and channel."""
    named = {task.name: task for task in results.suite.tasks}
    heads = {task.name: _head(task, named[task.beside]) for task in named.values() if task.beside in named}
    columns = sorted(dict.fromkeys(heads.values()), key=lambda head: not head.startswith(_SPEED_UP))
    shown: dict[tuple[str, str], dict[str, str]] = {}
    missions: dict[tuple[str, str], list[int]] = {}
    for row in rows:
        where, head = (row["task"].partition(", ")[0], row["strategy"]), heads[row["task"]]
        shown.setdefault(where, {})[head] = _text(row, inverse=head.startswith(_SPEED_UP))
        missions.setdefault(where, []).append(row["missions"])
    table = [
        [where[0], f"`{where[1]}`", _range(missions[where]), *(cells.get(head, "-") for head in columns)]
        for where, cells in shown.items()
    ]
    return markdown_table(["world", "strategy", "missions", *columns], table)


_SPEED_UP = "speed-up"


def _head(task: Task, beside: Task) -> str:
    """Of the column of a task: the team size that differs, or the channel."""
    if task.scenario.robots != beside.scenario.robots:
        return f"{_SPEED_UP}, {task.name.partition(', ')[2]}"
    return "time, " + task.name.removeprefix(f"{beside.name}, ")


def _text(row: Row, inverse: bool) -> str:
    """The time over that beside it, or its inverse; a bound where missions of one side were cut off."""
    cut_off = [row[name] < row["missions"] for name in ("finished", "beside_finished")]
    if all(cut_off):
        return "-"
    above, below = reversed(cut_off) if inverse else cut_off
    middle, low, high = (row[f"time_over{end}"] for end in ("", "_low", "_high"))
    interval = Interval(1.0 / middle, 1.0 / high, 1.0 / low) if inverse else Interval(middle, low, high)
    return ("> " if above else "< " if below else "") + interval.text()


def _range(counts: list[int]) -> str:
    least, most = min(counts), max(counts)
    return str(least) if least == most else f"{least} … {most}"
