"""Suites: pinned worlds, starts and seeds, so that figures of different strategies can be compared.

A suite is a module of data: TITLE, MEASURES, STRATEGIES, and `tasks(quick)`.
"""

from __future__ import annotations

from collections.abc import Sequence

from baselines.suites import faults, others, plans, teams, volumes
from baselines.suites.suite import Suite
from entropy_explore_env.errors import SettingError, one_of

SUITES = {"plans": plans, "volumes": volumes, "teams": teams, "others": others, "faults": faults}
"""Name → module."""
SCOREBOARD = ("plans", "volumes", "teams", "others")
"""Suites that stand on one page; the other one has a page of its own."""


def suite_strategies(name: str) -> tuple[str, ...]:
    """Return the strategies of a suite's table.

    Raises:
        SettingError: No suite has this name.
    """
    _check_suite(name)
    return SUITES[name].STRATEGIES


def find_suite(name: str, quick: bool = False, strategies: Sequence[str] | None = None) -> Suite:
    """Return the suite with a name.

    Args:
        name: One of SUITES.
        quick: Few worlds and starts.
        strategies: Names; None = those of its table.

    Raises:
        SettingError: No suite has this name, or its worlds are not where they should be.
    """
    _check_suite(name)
    module = SUITES[name]
    later = getattr(module, "later_tasks", None)
    chosen = module.STRATEGIES if strategies is None else tuple(strategies)
    return Suite(name, module.TITLE, module.tasks(quick), chosen, module.MEASURES, later)


def _check_suite(name: str) -> None:
    """Raise an error if no suite has this name."""
    if name not in SUITES:
        raise SettingError("suite", name, one_of(name, SUITES))
