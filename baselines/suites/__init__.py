"""Suites: pinned worlds, starts and seeds, so that figures of different strategies can be compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from baselines.strategies.table import suite_names
from baselines.suites import c2, faults, prediction, scoreboard
from baselines.suites.suite import PATH, TIME_99, Suite
from entropy_explore_env.errors import SettingError, one_of

SUITES: dict[str, Callable[[bool], Suite]] = {
    "plans": lambda quick: Suite(
        "plans",
        "Plans: until everything is seen",
        scoreboard.plan_tasks(quick),
        suite_names("plans"),
        (PATH, TIME_99),
    ),
    "volumes": lambda quick: Suite(
        "volumes",
        "Volumes and offices: until the map is known",
        scoreboard.volume_tasks(quick),
        suite_names("volumes"),
    ),
    "teams": lambda quick: Suite(
        "teams", "Teams and channels", scoreboard.team_tasks(quick), suite_names("teams")
    ),
    "others": lambda quick: Suite(
        "others", "Other scenarios, as they stand", scoreboard.other_tasks(quick), suite_names("others")
    ),
    "c2": lambda quick: Suite(
        "c2", "C²-Explorer's buildings", c2.tasks(quick), suite_names("c2"), c2.MEASURES
    ),
    "faults": lambda quick: Suite(
        "faults",
        "Teams whose robots and messages fail",
        faults.tasks(quick),
        faults.STRATEGIES,
        later=faults.later_tasks,
    ),
    "prediction": lambda quick: Suite(
        "prediction",
        "Plans with a predicted map",
        prediction.tasks(quick),
        prediction.STRATEGIES,
        prediction.MEASURES,
        reference=prediction.WITHOUT,
    ),
}
"""Name → what makes the suite, quick or whole, with the strategies of its table."""
SCOREBOARD = ("plans", "volumes", "teams", "others")
"""Suites that stand on one page; each other one has a page of its own."""


def find_suite(name: str, quick: bool = False, strategies: Sequence[str] | None = None) -> Suite:
    """Return the suite with a name.

    Args:
        name: One of SUITES.
        quick: Few worlds and starts.
        strategies: Names; None = those of its table.

    Raises:
        SettingError: No suite has this name.
    """
    if name not in SUITES:
        raise SettingError("suite", name, one_of(name, SUITES))
    suite = SUITES[name](quick)
    return suite if strategies is None else replace(suite, strategies=tuple(strategies))
