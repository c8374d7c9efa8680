"""The named scenarios that no other suite has, as they stand, with their own teams."""

from __future__ import annotations

from baselines.strategies.table import suite_names
from baselines.suites.suite import QUICK_STARTS, STARTS, TIME, TIME_90, Task, task_in, team_name
from entropy_explore_env.settings.scenarios import SCENARIOS

TITLE = "Other scenarios, as they stand"
MEASURES = (TIME, TIME_90)
STRATEGIES = suite_names("others")
NAMED = (
    "box-7x11x5",
    "lab",
    "occlusions",
    "cliff",
    "bhattacharya-office",
    "bhattacharya-cluttered",
    "office-mixed",
    "terrain-smooth",
    "terrain-rough",
)
QUICK_NAMED = ("box-7x11x5", "lab", "bhattacharya-office")


def tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks."""
    return tuple(
        task_in(team_name(name, SCENARIOS[name].robots), SCENARIOS[name], QUICK_STARTS if quick else STARTS)
        for name in (QUICK_NAMED if quick else NAMED)
    )
