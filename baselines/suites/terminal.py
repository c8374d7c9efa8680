"""Results of a suite in the terminal, and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from baselines.experiments.tables import terminal_table
from baselines.experiments.worker_pool import place_of
from baselines.strategies import shown_name, shown_names
from baselines.suites.page import shown, tasks_table
from baselines.suites.results import Results, failed_rows, overall_rows, task_rows


def printed_results(results: Results) -> dict[str, Any]:
    """Return all rows, for JSON; an interval is a list of the figure and its ends."""
    return {
        "suite": results.suite.name,
        "overall": overall_rows(results),
        "tasks": task_rows(results),
        "failed": failed_rows(results),
    }


def show_results(results: Results, refused: Sequence[str], tables: bool) -> None:
    """Print a table over all tasks, what failed, what was refused, and with `tables` a table of each task."""
    if tables:
        print(tasks_table(results))
    own = results.suite.name == "own"
    print(", ".join(task.name for task in results.tasks) if own else results.suite.title)
    print(f"ratios: over {results.reference}'s\n")
    print(_overall_table(results))
    for row in failed_rows(results):
        missions = ", ".join(map(str, row["missions"]))
        where = f"{shown_name(row['strategy'])}, {row['task']}, missions {missions}"
        (task,) = (task for task in results.tasks if task.name == row["task"])
        trace = results.numbered(task, row["strategy"])[row["missions"][0]].get("trace", "")
        print(f"failed: {where}: {row['reason']}{place_of(trace)}")
    for reason in refused:
        print(f"refused: {reason}")
    if not any(row["finished"] for row in overall_rows(results)):
        print("No mission was finished in its time: the ratios say nothing.")


def _overall_table(results: Results) -> str:
    """Return a row for each strategy."""
    measure, rows = results.suite.measures[0], overall_rows(results)
    names = shown_names(row["strategy"] for row in rows)
    cells = [
        [
            names[row["strategy"]],
            row["missions"],
            "-" if row["finished"] is None else f"{row['finished']:.0%}",
            shown(row[f"{measure.name}_ratio"], ".2f"),
            "-" if row["decision_ms"] is None else f"{row['decision_ms']:.2f}",
        ]
        for row in rows
    ]
    return terminal_table(["strategy", "missions", "finished", measure.words, "ms a decision"], cells)
