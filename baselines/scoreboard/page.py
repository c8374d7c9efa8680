"""The page of results: a part for each suite, with its tables and figures beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl

from baselines.cli.figures import STYLE, png
from baselines.experiments.tables import csv_table, markdown_table
from baselines.scoreboard.effects import effect_rows, effects_table
from baselines.scoreboard.figures import ratio_figure, task_figure
from baselines.scoreboard.results import (
    BITS,
    SEEN,
    Measure,
    Results,
    Row,
    failed_rows,
    mission_rows,
    overall_rows,
    task_rows,
)
from baselines.scoreboard.suites import Task
from entropy_explore_env.writing import write_atomically

PAGE, FILES, PART = "scoreboard.md", "scoreboard", "part.txt"
"""The page, the folder beside it, and in a suite's folder its part of the page."""
ARCHIVE = "missions.jsonl.xz"
"""All missions of a suite, in its folder."""
_DIGITS = 6
"""Significant digits of the CSV tables."""
_CLOCK = ("decision_ms", "worst_decision_ms")
"""Columns that differ from run to run; they stand in a table of their own."""


def write_page(folder: Path, results: Results, command: str) -> Path:
    """Write what a suite came to, and the page that joins it with the other suites in the folder.

    All but milliseconds, which `timing.csv` and the page's last columns tell, depends on the missions alone;
    the missions' files keep the milliseconds, too: whatever was stopped and started again, the bytes are the
    same.

    Args:
        folder: Where; `scoreboard/SUITE/` holds a suite's part of the page, its tables and figures.
        results: Of the suite.
        command: What made them.

    Returns:
        Path of the page.
    """
    suite = results.suite.name
    beside = folder / FILES / suite
    tasks, overall = task_rows(results), overall_rows(results)
    with mpl.rc_context(STYLE):
        write_atomically(beside / "ratios.png", png(ratio_figure(results, overall)))
        write_atomically(beside / "tasks.png", png(task_figure(results)))
    tables = {
        "overall": _without_clock(overall),
        "tasks": _without_clock(tasks),
        "missions": mission_rows(results),
    }
    if effects := effect_rows(results):
        tables["effects"] = effects
    for name, rows in tables.items():
        write_atomically(beside / f"{name}.csv", csv_rows(rows))
    names = ("task", "strategy", *_CLOCK)
    write_atomically(beside / "timing.csv", csv_rows([{name: row[name] for name in names} for row in tasks]))
    part = "\n\n".join(text.strip() for text in _parts(results, tasks, overall, command)) + "\n"
    write_atomically(beside / PART, part)
    found = [folder / FILES / name / PART for name in _TITLES]
    text = _READING + "\n" + "\n".join(path.read_text() for path in found if path.is_file())
    write_atomically(folder / PAGE, text)
    return folder / PAGE


def csv_rows(rows: Sequence[Row]) -> str:
    """Rows of equal keys as CSV; nothing where there is no figure."""
    return csv_table({name: [_cell(row[name]) for row in rows] for name in rows[0]})


def _cell(value: object) -> object:
    if value is None:
        return ""
    return f"{value:.{_DIGITS}g}" if isinstance(value, float) else value


def _without_clock(rows: Sequence[Row]) -> list[Row]:
    return [{name: value for name, value in row.items() if name not in _CLOCK} for row in rows]


_READING = """# Scoreboard

Strategies on the same worlds, starts and seeds, in suites that are pinned (`baselines/scoreboard/suites.py`).

- A ratio is the geometric mean of paired missions' ratios, over all tasks the geometric mean of the
  tasks'; below 1 is better. Intervals (…) hold 95 %: a bootstrap over pairs, within each task. An interval
  over fewer than about ten missions is too narrow, and a single mission has none.
- A mission that was cut off, or failed, counts with the time limit, and with the path that the team
  could have driven in it. Where both of a pair were cut off their ratio is 1.
- In suites, a strategy that finishes none of its first three missions of a task is not run further there.
- Seen: measured by any robot of the team, of the voxels that can be seen at all. Bits: what the best map
  lost, of the bits that the mission asks for.
- Up to commit `aefa487`, which holds its code, `information-rate-v0` stood here, too. To the mission's end it
  took 0.42 (0.41 … 0.44) of `nearest-frontier`'s time in `volumes`, 0.56 (0.54 … 0.57) in `teams` and 0.79
  (0.68 … 1.00) in `others`, and in `plans` 1.78 (1.40 … 2.51) of its path, over 18 missions.
- Thirty starts a task are the whole; where fewer have been run yet rows say how many, and ratios are of
  those that both have run. Tasks of which none has been run are left out.
- ms a decision: of one robot, on the clock, the median over missions of their medians, and the worst of
  all; other missions ran beside them, so that what they cost on a quiet machine is less ([speed](speed.md)).
- `missions.jsonl.xz` among a suite's files holds all of its missions. A strategy of one's own takes part by
  `python -m baselines.benchmark --suite NAME --strategies MODULE:CLASS --archive FILE --confirm`: the others'
  missions are taken from the file, and run again only where the code has changed what comes out
  ([a strategy of one's own](../own_strategy.md)).
"""


def _parts(results: Results, tasks: list[Row], overall: list[Row], command: str) -> list[str]:
    """The suite's part of the page from top to bottom."""
    suite = results.suite
    beside = f"{FILES}/{suite.name}"
    parts = [
        f"## {_TITLES[suite.name]}",
        f"Written by `{command}`." + (CONFIRMED if "--confirm" in command.split() else ""),
        *_overall_parts(results, overall),
        f"![Ratios with intervals]({beside}/ratios.png)",
        f"![Ratios by task]({beside}/tasks.png)",
    ]
    effects = effect_rows(results)
    if effects:
        parts += [_EFFECTS, effects_table(results, effects)]
    for task in suite.tasks:
        rows = [row for row in tasks if row["task"] == task.name]
        if rows:
            parts += [
                f"### {task.name}",
                about(task, max(len(results.of(task, strategy)) for strategy in suite.strategies)),
                _task_table(results, rows),
            ]
    failed = failed_rows(results)
    if failed:
        parts += ["### Missions that failed", _failed_table(failed)]
    tables = ["overall", "tasks", *(["effects"] if effects else []), "missions", "timing"]
    files = [*(f"{name}.csv" for name in tables), ARCHIVE]
    parts.append("Files: " + ", ".join(f"[`{name}`]({beside}/{name})" for name in files) + ".")
    return parts


_EFFECTS = """### What more robots and worse channels change

Each strategy beside itself, on the same worlds, missions paired by their number. Speed-up: the time of one
robot over that of the team, with a channel that carries everything. Time: of four robots, over that of four
with such a channel. Geometric means; a mission that was cut off counts with the time limit, so that a figure
is a bound (>, <) where that was on one side, and left out where on both."""
CONFIRMED = (
    " Some missions may have been run by an earlier version of the code: the first one of their strategy and"
    " task was run again by the last version, and came out the same."
)
"""What a page says that was written with --confirm."""
_TITLES: Mapping[str, str] = {
    "plans": "Plans: until everything is seen",
    "volumes": "Volumes and offices: until the map is known",
    "teams": "Teams and channels",
    "others": "Other scenarios, as they stand",
    "own": "Scenarios of one's own",
}


def _overall_parts(results: Results, rows: list[Row]) -> list[str]:
    """The table of those that ran, and the names of the others."""
    absent = [f"`{who}`" for who in results.suite.strategies if who not in results.ran]
    return [_overall_table(results, rows), *([f"Not run yet: {', '.join(absent)}."] if absent else [])]


def _overall_table(results: Results, rows: list[Row]) -> str:
    measures, reference = results.judged_by, results.reference
    head = [
        "strategy",
        "tasks",
        "missions",
        "finished",
        *(f"{m.words}, over `{reference}`" for m in measures),
    ]
    first = f"{measures[0].name}_over_{reference}"
    ordered = sorted(rows, key=lambda row: (row[first] is None, row[first]))
    shown = [
        [
            f"`{row['strategy']}`",
            row["tasks"],
            row["missions"],
            "-" if row["finished"] is None else f"{row['finished']:.0%}",
            *(ranged(row, f"{m.name}_over_{reference}", ".2f") for m in measures),
            *_milliseconds(row),
        ]
        for row in ordered
    ]
    return markdown_table([*head, "ms a decision", "worst"], shown)


def _task_table(results: Results, rows: list[Row]) -> str:
    plans = results.suite.name == "plans"
    marks = [Measure("path_m", share) for share in SEEN]
    if not plans:
        marks = [Measure("time_s", share, "bits") for share in BITS]
    unit = "path (m)" if plans else "time (s)"
    head = ["strategy", "finished", *(measure.words for measure in results.judged_by)]
    head += [f"{unit} to " + " / ".join(str(mark.share) for mark in marks) + f" % {marks[0].of}"]
    head += [f"over `{results.reference}`"]
    first = results.judged_by[0]
    shown = [
        [
            f"`{row['strategy']}`",
            f"{row['finished']} of {row['missions']}"
            + (f", {row['failed']} failed" if row["failed"] else ""),
            *(_limited(row, measure) for measure in results.judged_by),
            " / ".join(_number(row[f"median_{mark.name}"]) for mark in marks),
            ranged(row, f"{first.name}_over_{results.reference}", ".2f"),
            *_milliseconds(row),
        ]
        for row in sorted(rows, key=lambda row: row[first.name])
    ]
    return markdown_table([*head, "ms a decision", "worst"], shown)


def _limited(row: Row, measure: Measure) -> str:
    """A median with its interval; > the limit, where half of the missions were cut off."""
    limit = row[f"{measure.name}_limit"]
    if limit is not None and row[measure.name] >= limit:
        return f"> {limit:,.0f}"
    return ranged(row, measure.name, ",.0f")


def _milliseconds(row: Row) -> list[str]:
    return [_number(row[name], ",.2f") for name in _CLOCK]


def _number(value: float | None, form: str = ",.0f") -> str:
    return "-" if value is None else f"{value:{form}}"


def ranged(row: Row, name: str, form: str) -> str:
    """A figure and its interval; without one that has no width, as of a reference over itself."""
    if row[name] is None:
        return "-"
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    if low == high:
        return f"{row[name]:{form}}"
    return f"{row[name]:{form}} ({low:{form}} … {high:{form}})"


def _failed_table(rows: list[Row]) -> str:
    """A row of each strategy and reason."""
    alike: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        alike.setdefault((row["strategy"], row["reason"]), []).append(row)
    shown = [
        [f"`{strategy}`", "; ".join(_missions_of(row) for row in own), _plain(reason)]
        for (strategy, reason), own in alike.items()
    ]
    return markdown_table(["strategy", "tasks and missions", "reason"], shown)


def _missions_of(row: Row) -> str:
    numbers = row["missions"]
    return f"{row['task']}: {', '.join(map(str, numbers))}"


def _plain(text: str) -> str:
    """As it is, whatever Markdown would make of it."""
    return "".join(f"\\{sign}" if sign in r"\`*_{}[]<>()#!|~" else sign for sign in text)


def about(task: Task, missions: int) -> str:
    """What kind of missions a task has.

    Args:
        task: Which.
        missions: Run by the strategy that ran most of them.
    """
    scenario = task.scenario
    grid, around = scenario.grid, task.places[0].surroundings
    files = [Path(scenario.world)] if around is None or not around.worlds else around.files()
    shape = " × ".join(map(str, grid.shape if not grid.flat else grid.shape[:2]))
    moving = ["ground" if kind.robot.motion == "planar" else "flying" for kind in scenario.kinds]
    kind = " and ".join(dict.fromkeys(moving))
    worlds = f"{len(task.places)} worlds" if len(task.places) > 1 else f"world `{scenario.world}`"
    if files[0].is_file() and len(task.places) == 1:
        names = [f"`{name}`" for name in dict.fromkeys(file.name for file in files)]
        worlds = f"world file{'s' if len(names) > 1 else ''} {', '.join(names)}"
    team = f"{scenario.robots} {kind} robot" + ("s" if scenario.robots > 1 else "")
    sensor = scenario.sensor
    if math.isfinite(sensor.scan_every_m):
        team += f" that scans {sensor.rays} rays of {sensor.max_range_m:g} m every {sensor.scan_every_m:g} m"
    starts = (
        f"{task.missions} starts" if missions >= task.missions else f"{missions} of {task.missions} starts"
    )
    return (
        f"{starts}, {worlds}, {shape} voxels of {grid.voxel_size_m:g} m, {team}, "
        f"time limit {scenario.ending.time_limit_s:,.0f} s."
    )
