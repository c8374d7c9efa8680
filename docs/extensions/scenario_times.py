"""How long strategies take in a scenario, by the archives of missions in `docs/results`."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from baselines.experiments.rows import read_table
from baselines.experiments.statistics import median_interval
from baselines.suites import find_suite
from baselines.suites.page import archive_of
from baselines.suites.results import Results, results_of
from baselines.suites.suite import TIME, TIME_99
from entropy_explore_env.settings.scenario import Scenario


class Time(NamedTuple):
    """How long a strategy takes in a task."""

    task: str
    strategy: str
    missions: int
    finished: int
    seconds: str
    page: str


def times_table(scenario: Scenario, results: Path) -> str:
    """Return the section of a scenario's page; empty where nothing was measured.

    Args:
        scenario: One of the named scenarios.
        results: The folder with the pages of results and their archives.
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
    "plans": (TIME_99, " (to 99 % seen)"),
    "volumes": (TIME, ""),
    "others": (TIME, ""),
}
"""Suite → the time that is shown, and what is said of it; teams and channels stand on the page alone."""


def scoreboard_times(scenario: str, results: Path) -> list[Time]:
    """Return the times in tasks of this scenario: `office`, or `office, 3 robots`."""
    times = []
    for suite, (measure, words) in SUITES.items():
        found = suite_results(suite, archive_of(results, suite))
        for task in found.tasks:
            name, _, team = task.name.partition(", ")
            for strategy in found.suite.strategies if name == scenario else ():
                if records := found.of(task, strategy):
                    finished = sum(record.get("finished", False) for record in records)
                    seconds = format(median_interval(found.values(task, strategy, measure)), ",.0f")
                    who = (team or "1 robot") + words
                    times.append(Time(who, strategy, len(records), finished, seconds, "scoreboard"))
    return times


@lru_cache(maxsize=len(SUITES))
def suite_results(suite: str, archive: Path) -> Results:
    """Return what the missions of an archive came to; those of no missions where there is none."""
    return results_of(find_suite(suite), read_table(archive))[0]
