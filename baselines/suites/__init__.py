"""Suites: pinned worlds, starts and seeds, so that figures of different strategies can be compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from baselines.strategies.table import suite_names
from baselines.suites import faults, scoreboard
from baselines.suites.suite import PATH, TIME, TIME_90, TIME_99, Later, Measure, Suite, Task
from entropy_explore_env.errors import SettingError, one_of


class Pinned(NamedTuple):
    """A suite as data: its title, its tasks of a quick or a whole run, and what missions are judged by."""

    title: str
    tasks: Callable[[bool], tuple[Task, ...]]
    strategies: tuple[str, ...]
    measures: tuple[Measure, ...] = (TIME, TIME_90)
    later: Later | None = None


SUITES = {
    "plans": Pinned(
        "Plans: until everything is seen", scoreboard.plan_tasks, suite_names("plans"), (PATH, TIME_99)
    ),
    "volumes": Pinned(
        "Volumes and offices: until the map is known", scoreboard.volume_tasks, suite_names("volumes")
    ),
    "teams": Pinned("Teams and channels", scoreboard.team_tasks, suite_names("teams")),
    "others": Pinned("Other scenarios, as they stand", scoreboard.other_tasks, suite_names("others")),
    "faults": Pinned(
        "Teams whose robots and messages fail", faults.tasks, faults.STRATEGIES, later=faults.later_tasks
    ),
}
SCOREBOARD = ("plans", "volumes", "teams", "others")
"""Suites that stand on one page; the other one has a page of its own."""


def suite_strategies(name: str) -> tuple[str, ...]:
    """Return the strategies of a suite's table.

    Raises:
        SettingError: No suite has this name.
    """
    return _pinned(name).strategies


def find_suite(name: str, quick: bool = False, strategies: Sequence[str] | None = None) -> Suite:
    """Return the suite with a name.

    Args:
        name: One of SUITES.
        quick: Few worlds and starts.
        strategies: Names; None = those of its table.

    Raises:
        SettingError: No suite has this name, or its worlds are not where they should be.
    """
    found = _pinned(name)
    chosen = found.strategies if strategies is None else tuple(strategies)
    return Suite(name, found.title, found.tasks(quick), chosen, found.measures, found.later)


def _pinned(name: str) -> Pinned:
    """Return what a suite consists of, or raise an error if none has this name."""
    if name not in SUITES:
        raise SettingError("suite", name, one_of(name, SUITES))
    return SUITES[name]
