"""Results of a suite in the terminal, and as JSON."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from baselines.experiments.outcome import Record
from baselines.experiments.runner import TRACE
from baselines.scoreboard.page import ranged
from baselines.scoreboard.results import Results, Row, failed_rows, overall_rows, task_rows


def printed_results(results: Results) -> dict[str, Any]:
    """All rows, for JSON."""
    return {
        "suite": results.suite.name,
        "overall": overall_rows(results),
        "tasks": task_rows(results),
        "failed": failed_rows(results),
    }


def show_results(results: Results) -> None:
    """A table over all tasks on standard output, and missions that failed."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    measure, reference = results.judged_by[0], results.reference
    names = ", ".join(task.name for task in results.suite.tasks)
    table = Table(
        title=f"{names}\nratios: over {reference}'s",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    table.add_column("strategy", overflow="fold")
    for head in ("missions", "finished", measure.words, "ms a\ndecision"):
        table.add_column(head, justify="right", no_wrap=True)
    name = f"{measure.name}_over_{reference}"
    for row in sorted(overall_rows(results), key=lambda row: (row[name] is None, row[name])):
        table.add_row(
            row["strategy"],
            str(row["missions"]),
            "-" if row["finished"] is None else f"{row['finished']:.0%}",
            ranged(row, name, ".2f"),
            "-" if row["decision_ms"] is None else f"{row['decision_ms']:.2f}",
        )
    console = Console()
    console.print(table)
    for row in failed_rows(results):
        missions = ", ".join(map(str, row["missions"]))
        place = _place_of(results, row)
        line = f"failed: {row['strategy']}, {row['task']}, missions {missions}: {row['reason']}{place}"
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    if not any(row["finished"] for row in overall_rows(results)):
        console.print("No mission was finished in its time: the ratios say nothing.", highlight=False)


def broken(results: Results) -> list[str]:
    """Strategies of which every mission that was run raised an error, but for refusals of a scenario."""
    return [who for who in results.ran if all(map(_raised, _records(results, who)))]


def _records(results: Results, strategy: str) -> list[Record]:
    return [record for task in results.suite.tasks for record in results.of(task, strategy)]


def _raised(record: Record) -> bool:
    said = record.get("failed", "")
    return bool(record.get(TRACE)) and not said.startswith(("SettingError", "WorldError"))


def _place_of(results: Results, row: Row) -> str:
    """File and line where missions of a row failed, if their process told."""
    (task,) = (task for task in results.suite.tasks if task.name == row["task"])
    trace = results.numbered(task, row["strategy"])[row["missions"][0]].get(TRACE, "")
    frames = re.findall(r'File "([^"]+)", line (\d+)', trace)
    return f" ({Path(frames[-1][0]).name}, line {frames[-1][1]})" if frames else ""
