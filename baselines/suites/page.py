"""Pages of suites, from Jinja2 templates: a table over all tasks, a figure, an archive of all missions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from baselines.experiments.claims import Claim
from baselines.experiments.page import Page
from baselines.experiments.rows import Row as KeptRow
from baselines.experiments.rows import origins_line, read_table, write_table
from baselines.experiments.statistics import Interval
from baselines.experiments.tables import csv_table, latex_table, markdown_table
from baselines.strategies import shown_names
from baselines.suites import SCOREBOARD, entries, find_suite
from baselines.suites.faults import CONDITIONS, LOST_ISOLATED, NOTHING_FAILS, Times, all_claims
from baselines.suites.figures import fault_figure, task_figure
from baselines.suites.prediction import bounds_table
from baselines.suites.results import Results, Row, failed_rows, overall_rows, results_of, task_rows
from baselines.suites.suite import Measure, Task
from entropy_explore_env.errors import counted
from entropy_explore_env.writing import write_atomically

_TEMPLATES = Path(__file__).parent


def page_of(suite: str) -> str:
    """Return the name of the page on which a suite stands, and of the folder beside it."""
    return "scoreboard" if suite in SCOREBOARD else suite


def archive_of(folder: Path, suite: str) -> Path:
    """Return where all missions of a suite lie: in a folder beside its page."""
    return folder / page_of(suite) / f"{suite}.jsonl.xz"


def write_page(
    folder: Path, results: Results, rows: Sequence[KeptRow], command: str, refused: Sequence[str] = ()
) -> Path:
    """Write the archive of a suite's rows, and the page on which it stands.

    The page says the command that makes it, and why world files are refused.

    Returns:
        Path of the page.
    """
    name = results.suite.name
    archive_of(folder, name).parent.mkdir(parents=True, exist_ok=True)
    write_table(archive_of(folder, name), rows)
    texts = {"command": command, "refused": refused}
    if name in SCOREBOARD:
        read = {each: read_table(archive_of(folder, each)) for each in SCOREBOARD}
        found = {each: results_of(find_suite(each), kept) for each, kept in read.items() if kept}
        figures = {each: partial(task_figure, part[0]) for each, part in found.items()}
        tables = {each: partial(overall_table, part[0]) for each, part in found.items()}
        texts |= {"parts": [part_texts(*part) for part in found.values()]}
        texts["entries"] = entries_table(folder / "scoreboard" / "entries")
    elif name == "faults":
        times = Times(results)
        claims = all_claims(times)
        figures = {"faults": partial(fault_figure, times)}
        tables = {"ratios": partial(ratios_table, times), "judged": partial(judged_table, times, claims)}
        texts |= {
            **part_texts(results, rows),
            "nothing_breaks": claims[0],
            "held": f"{sum(claim.holds for claim in claims)} of {len(claims)} hold",
            "cut": sum(not record.get("finished", False) for record in times.all_records()),
            "seeds": max(map(len, results.records.values())),
        }
    elif name == "prediction":
        figures, tables = {}, {"bounds": partial(bounds_table, results)}
        texts |= part_texts(results, rows)
    else:
        figures = {"tasks": partial(task_figure, results)}
        tables = {"overall": partial(overall_table, results), "tasks": partial(tasks_table, results)}
        texts |= {**part_texts(results, rows), "failed": failed_table(results)}
    page = Page(_TEMPLATES / f"{page_of(name)}.md.j2", figures, tables, texts=texts)
    return page.write(folder, page_of(name))


def part_texts(results: Results, rows: Sequence[KeptRow]) -> dict[str, Any]:
    """Return what a template says of a suite."""
    return {
        "name": results.suite.name,
        "title": results.suite.title,
        "missions": len(rows),
        "wanted": len(results.suite.strategies) * sum(task.missions for task in results.suite.tasks),
        "rows": origins_line(rows),
        "absent": [name for name in results.suite.strategies if name not in results.ran],
    }


def overall_table(results: Results) -> str:
    """Return the table over all tasks: a row a strategy, best first."""
    head, rows = _overall(results, overall_rows(results))
    return markdown_table(head, [[f"`{name}`", *cells] for name, *cells in rows])


def cite(folder: Path, results: Results) -> None:
    """Write the table over all tasks as LaTeX and CSV, and the figure of the tasks as PDF."""
    name, overall = results.suite.name, overall_rows(results)
    head, rows = _overall(results, overall)
    plain = [[str(cell).replace("…", "to") for cell in row] for row in rows]
    latex_head = [text.replace("`", "") for text in head]
    write_atomically(folder / f"{name}.tex", latex_table(latex_head, plain))
    columns: dict[str, Sequence[object]] = {
        key: [row[key] for row in overall] for key in ("strategy", "tasks", "missions", "finished")
    }
    for measure in results.suite.measures:
        ratios = [row[f"{measure.name}_ratio"] for row in overall]
        for part in ("value", "low", "high"):
            found = [None if ratio is None else getattr(ratio, part) for ratio in ratios]
            columns[f"{measure.name}_ratio_{part}"] = found
    write_atomically(folder / f"{name}.csv", csv_table(columns))
    task_figure(results).savefig(folder / f"{name}.pdf", metadata={"CreationDate": None})


def _overall(results: Results, overall: Sequence[Row]) -> tuple[list[str], list[list[object]]]:
    """Return head and cells of a table over all tasks, of these rows of `overall_rows`."""
    measures = results.suite.measures
    head = ["strategy", "tasks", "missions", "finished"]
    head += [f"{measure.words}, over `{results.reference}`" for measure in measures]
    names = shown_names(row["strategy"] for row in overall)
    return head, [
        [
            names[row["strategy"]],
            row["tasks"],
            row["missions"],
            "-" if row["finished"] is None else f"{row['finished']:.0%}",
            *(shown(row[f"{measure.name}_ratio"], ".2f") for measure in measures),
        ]
        for row in overall
    ]


def entries_table(folder: Path) -> str:
    """Return the table of the entries in a folder, one a row; empty if there are none.

    Ratios are relative to the reference's missions in the archives of the pages to which that folder belongs.
    """
    described = ["strategy", "by", "suite", "tasks", "missions", "finished"]
    head = [*described, "first ratio", "second ratio", "checked"]
    rows: list[list[object]] = []
    for entry in sorted(each.parent for each in folder.glob(f"*/{entries.ABOUT}")):
        about, check = entries.read_about(entry), entries.read_check(entry)
        archived = read_table(archive_of(folder.parents[1], about.suite))
        suite = find_suite(about.suite, about.quick, about.strategies)
        kept = [row for row in archived if row.settings.get("strategy") == suite.reference]
        results, _ = results_of(suite, [*kept, *read_table(entry / entries.ROWS)])
        own = [row for row in overall_rows(results) if row["strategy"] in about.strategies]
        checked = "no"
        if check is not None:
            checked = f"{check.held} of {check.rows} rows" if check.held < check.rows else "yes"
        form = f"{about.suite}, quick" if about.quick else about.suite
        for name, *cells in _overall(results, own)[1]:
            link = f"[`{name}`](scoreboard/entries/{entry.name})"
            rows.append([link, about.author, form, *cells[: len(head) - 4], checked])
    return markdown_table(head, rows) if rows else ""


_TASK_COLUMNS = {
    "scans": ("scans", ",.0f"),
    "distance_m": ("driven (m)", ",.0f"),
    "explored": ("explored", ".1%"),
    "map_error": ("map error", ".3f"),
}
"""Figure of a task → head of its column, and format."""
_TEAM_COLUMNS = {"balance": ("imbalance", ".2f"), "bits_sent": ("bits sent", ",.0f")}
"""The same, where there is a team."""


def tasks_table(results: Results) -> str:
    """Return a table for each task, below a line about it: a row per strategy, with medians over missions."""
    measures = results.suite.measures
    head = ["strategy", "finished", *(measure.words for measure in measures), f"over `{results.reference}`"]
    teams = any(task.scenario.robots > 1 for task in results.tasks)
    columns = _TASK_COLUMNS | (_TEAM_COLUMNS if teams else {})
    head += [words for words, _ in columns.values()]
    first, parts = measures[0].name, []
    all_rows = sorted(task_rows(results), key=lambda row: row[first])
    names = shown_names({row["strategy"] for row in all_rows})
    for task in results.tasks:
        rows = [row for row in all_rows if row["task"] == task.name]
        cells = [[f"`{names[row['strategy']]}`", *_task_cells(row, measures, columns)] for row in rows]
        parts.append(f"**{task.name}**: {about(task)}\n\n{markdown_table(head, cells)}")
    return "\n".join(parts)


def _task_cells(row: Row, measures: Sequence[Measure], columns: Mapping[str, tuple[str, str]]) -> list[str]:
    finished = f"{row['finished']} of {row['missions']}" + (
        f", {row['failed']} failed" if row["failed"] else ""
    )
    cells = [finished]
    for measure in measures:
        limit = row[f"{measure.name}_limit"]
        cut = row[measure.name].value >= limit
        cells.append(f"> {limit:,.0f}" if cut else shown(row[measure.name], ",.0f"))
    cells.append(shown(row[f"{measures[0].name}_ratio"], ".2f"))
    figures = ((row[name], form) for name, (_, form) in columns.items())
    return cells + ["-" if value is None else format(value, form) for value, form in figures]


def shown(interval: Interval | None, form: str) -> str:
    """Return a figure and its interval; without one that has no width, as of a reference over itself."""
    if interval is None:
        return "-"
    return format(interval.value if interval.low == interval.high else interval, form)


def failed_table(results: Results) -> str:
    """Return a table of missions that failed, a row for each strategy and reason; empty if none did."""
    alike: dict[tuple[str, str], list[str]] = {}
    for row in failed_rows(results):
        missions = f"{row['task']}: {', '.join(map(str, row['missions']))}"
        alike.setdefault((row["strategy"], row["reason"]), []).append(missions)
    names = shown_names({name for name, _ in alike})
    rows = [[f"`{names[name]}`", "; ".join(where), _plain(reason)] for (name, reason), where in alike.items()]
    return markdown_table(["strategy", "tasks and missions", "reason"], rows) if rows else ""


def _plain(text: str) -> str:
    """Return a text that Markdown shows as it is."""
    return "".join(f"\\{sign}" if sign in r"\`*_{}[]<>()#!|~" else sign for sign in text)


def about(task: Task) -> str:
    """Return what kind of missions a task has."""
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
    team = counted(scenario.robots, f"{kind} robot")
    sensor = scenario.sensor
    if math.isfinite(sensor.scan_every_m):
        team += f" that scans {sensor.rays} rays of {sensor.max_range_m:g} m every {sensor.scan_every_m:g} m"
    return (
        f"{counted(task.missions, 'start')}, {worlds}, {shape} voxels of {grid.voxel_size_m:g} m, {team}, "
        f"time limit {scenario.ending.time_limit_s:,.0f} s."
    )


def ratios_table(times: Times) -> str:
    """Return what faults cost: mean times over those without faults."""
    conditions = [name for name in CONDITIONS if name not in (NOTHING_FAILS, LOST_ISOLATED)]
    rows = [
        [f"`{strategy}`", f"{team[0]}, {team[1]}", *_ratio_cells(times, team, strategy)]
        for team in times.teams
        for strategy in times.strategies
        if times.records(*team, strategy, NOTHING_FAILS)
    ]
    return markdown_table(["strategy", "team", *conditions], rows)


def judged_table(times: Times, claims: Sequence[Claim]) -> str:
    """Return what teams are held to: a row for each strategy and team."""
    judged, rows = {claim.id: claim for claim in claims}, []
    for team in times.teams:
        for strategy in times.strategies:
            cells = [f"`{strategy}`", f"{team[0]}, {team[1]}"]
            for kind in ("isolated", "lost"):
                claim = judged[f"{kind}-{team[0]}-{team[1]}-{strategy}"]
                value = (
                    "-" if claim.ours is None else f"{claim.ours:.2f} ({claim.low:.2f} … {claim.high:.2f})"
                )
                cells += [value, "yes" if claim.holds else "**no**"]
            rows.append(cells)
    head = ["strategy", "team", "over isolation, worst", "holds", "one lost", "holds"]
    return markdown_table(head, rows)


def _ratio_cells(times: Times, team: tuple[str, int], strategy: str) -> list[str]:
    """Return mean time over that without faults, under each condition; > where missions were cut off."""
    cells = []
    for name in CONDITIONS:
        if name not in (NOTHING_FAILS, LOST_ISOLATED):
            ratio = times.ratio(*team, strategy, name, NOTHING_FAILS)
            bound = "> " if times.cut_off(*team, strategy, name) else ""
            cells.append("-" if ratio is None else f"{bound}{ratio.value:.2f}")
    return cells
