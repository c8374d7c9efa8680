"""Results of a head-to-head in the terminal, and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.head_to_head.cells import BASELINE
from baselines.head_to_head.page import ranged
from baselines.head_to_head.rows import (
    REFERENCES,
    Results,
    clock_rows,
    failed_rows,
    overall_rows,
    scenario_rows,
)


def printed_results(results: Results) -> dict[str, Any]:
    """All rows, for JSON."""
    return {
        "seeds": results.entries.seeds,
        "overall": overall_rows(results),
        "scenarios": scenario_rows(results),
        "failed": failed_rows(results),
        "timing": clock_rows(results),
    }


def show_results(results: Results) -> None:
    """A table over all scenarios on standard output, and missions that failed."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    names = ", ".join(results.entries.scenarios)
    table = Table(
        title=f"{names}; {results.entries.seeds} seeds; relative time: over {BASELINE}'s",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        padding=0,
        pad_edge=False,
    )
    table.add_column("robots", justify="right")
    table.add_column("strategy", no_wrap=True)
    rows = overall_rows(results)
    references = [reference for reference in REFERENCES if f"faster_than_{reference}" in rows[0]]
    table.add_column("mapped", justify="right")
    table.add_column("relative time", justify="right", no_wrap=True)
    for head in (*(f"beats\n{reference}" for reference in references), "ms a\ndecision"):
        table.add_column(head, justify="right")
    clocks = clock_rows(results)
    last = None
    for row in rows:
        if last not in (None, row["robots"]):
            table.add_section()
        last = row["robots"]
        spent = [clock["decision_ms"] for clock in clocks if _same(clock, row) and clock["decision_ms"]]
        table.add_row(
            str(row["robots"]),
            row["strategy"],
            f"{row['mapped']:.0%}",
            ranged(row, "relative_time", ".2f"),
            *(_shown(row[f"faster_than_{reference}"]) for reference in references),
            _shown(float(np.mean(spent)) if spent else None),
        )
    console = Console()
    console.print(table)
    for row in failed_rows(results):
        where = f"{row['strategy']}, {row['scenario']}, robots {row['robots']}"
        seeds = ", ".join(map(str, row["seeds"]))
        console.print(f"failed: {where}, seeds {seeds}: {row['reason']}", markup=False, highlight=False)


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _same(clock: dict[str, Any], row: dict[str, Any]) -> bool:
    return all(clock[name] == row[name] for name in ("robots", "strategy"))
