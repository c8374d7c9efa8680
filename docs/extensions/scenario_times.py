"""How long strategies take in a scenario, by the tables of results that lie in `docs/results`."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

from entropy_explore_env.scenario import Scenario


class Time(NamedTuple):
    """How long a strategy takes in a task."""

    task: str
    strategy: str
    missions: str
    finished: str
    seconds: str
    page: str


def times_table(scenario: Scenario, results: Path) -> str:
    """The section of a scenario's page; empty where nothing was measured.

    Args:
        scenario: One of the named scenarios.
        results: The folder with the pages of results and their tables.
    """
    times = scoreboard_times(scenario.name, results)
    if not times:
        return ""
    rows = [
        f"| {t.task} | `{t.strategy}` | {t.seconds} | {t.finished} of {t.missions} "
        f"| [{t.page}](../results/{t.page}.md) |"
        for t in times
    ]
    head = "| team | strategy | mission time (s) | finished | from |\n| --- | --- | --- | --- | --- |\n"
    return "## How long strategies take\n\n" + head + "\n".join(rows)


SUITES = {
    "plans": ("time_s_99_seen", " (to 99 % seen)"),
    "volumes": ("time_s_end", ""),
    "others": ("time_s_end", ""),
}
"""Suite → its column of times, and what is said of them; teams and channels stand on the page alone."""


def scoreboard_times(scenario: str, results: Path) -> list[Time]:
    """Rows of `scoreboard/SUITE/tasks.csv` of this scenario: tasks `office`, or `office, 3 robots`."""
    times = []
    for suite, (column, words) in SUITES.items():
        for row in _rows(results / "scoreboard" / suite / "tasks.csv"):
            name, _, team = row["task"].partition(", ")
            if name == scenario:
                seconds = _interval(*(row.get(column + end) for end in ("", "_low", "_high")))
                who = (team or "1 robot") + words
                times.append(
                    Time(who, row["strategy"], row["missions"], row["finished"], seconds, "scoreboard")
                )
    return times


def _rows(path: Path) -> list[dict[str, str]]:
    """The rows of a table; none where there is no such file."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _interval(middle: str | None, low: str | None, high: str | None) -> str:
    """`33 (31 … 35)`."""
    if not middle:
        return "-"
    text = f"{float(middle):,.0f}"
    return f"{text} ({float(low):,.0f} … {float(high):,.0f})" if low and high else text
