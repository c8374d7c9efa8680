"""Results of a suite in the terminal, and as JSON."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from baselines.strategies import shown_name, shown_names
from baselines.suites.page import shown, tasks_table
from baselines.suites.results import Results, Row, failed_rows, overall_rows, task_rows


def printed_results(results: Results) -> dict[str, Any]:
    """Return all rows, for JSON; an interval is a list of the figure and its ends."""
    return {
        "suite": results.suite.name,
        "overall": overall_rows(results),
        "tasks": task_rows(results),
        "failed": failed_rows(results),
    }


def show_results(results: Results, refused: Sequence[str], tables: bool) -> None:
    """Print a table over all tasks, missions that failed, and world files that were refused.

    Args:
        results: Of the suite.
        refused: Why world files are refused.
        tables: Print the tables of all tasks, too, in Markdown.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    measure, reference = results.suite.measures[0], results.reference
    own = results.suite.name == "own"
    title = ", ".join(task.name for task in results.tasks) if own else results.suite.title
    table = Table(
        title=f"{title}\nratios: over {reference}'s",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    table.add_column("strategy", overflow="fold")
    for head in ("missions", "finished", measure.words, "ms a\ndecision"):
        table.add_column(head, justify="right", no_wrap=True)
    rows = overall_rows(results)
    names = shown_names(row["strategy"] for row in rows)
    for row in rows:
        table.add_row(
            names[row["strategy"]],
            str(row["missions"]),
            "-" if row["finished"] is None else f"{row['finished']:.0%}",
            shown(row[f"{measure.name}_ratio"], ".2f"),
            "-" if row["decision_ms"] is None else f"{row['decision_ms']:.2f}",
        )
    console = Console()
    if tables:
        print(tasks_table(results))
    console.print(table)
    for row in failed_rows(results):
        missions = ", ".join(map(str, row["missions"]))
        place = _place_of(results, row)
        name = shown_name(row["strategy"])
        line = f"failed: {name}, {row['task']}, missions {missions}: {row['reason']}{place}"
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    for reason in refused:
        console.print(f"refused: {reason}", markup=False, highlight=False, soft_wrap=True)
    if not any(row["finished"] for row in rows):
        console.print("No mission was finished in its time: the ratios say nothing.", highlight=False)


def _place_of(results: Results, row: Row) -> str:
    """Return file and line where missions of a row failed, if their process told."""
    (task,) = (task for task in results.tasks if task.name == row["task"])
    trace = results.numbered(task, row["strategy"])[row["missions"][0]].get("trace", "")
    frames = re.findall(r'File "([^"]+)", line (\d+)', trace)
    return f" ({Path(frames[-1][0]).name}, line {frames[-1][1]})" if frames else ""
