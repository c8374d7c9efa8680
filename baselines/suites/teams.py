"""Teams of 1, 2, 4 and 8 robots whose channel carries everything; teams of 4 also with worse ones.

In `office-signal` four robots share by the strength of signals, and each has to get the whole map.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from baselines.strategies.table import suite_names
from baselines.suites.bundled_worlds import in_world
from baselines.suites.suite import QUICK_STARTS, STARTS, TIME, TIME_90, Task, task_in, team_name
from entropy_explore_env.settings.scenarios import SCENARIOS

TITLE = "Teams and channels"
MEASURES = (TIME, TIME_90)
STRATEGIES = suite_names("teams")
NAMED = ("room-furnished", "office", "office-3d", "cave", "terrain")
QUICK_NAMED = ("office",)
BY_SIGNAL = "office-signal"
SIZES, SIZE_OF_WORSE_CHANNELS = (1, 2, 4, 8), (4,)
_WHOLE: Mapping[str, Any] = {"burst": 1_000_000, "i_min_bits": 0.0}
CHANNELS: Mapping[str, Mapping[str, Any]] = {
    "": _WHOLE,
    ", burst 64": {"burst": 64},
    ", half of the messages lost": {**_WHOLE, "loss_probability": 0.5},
    ", in line of sight": {**_WHOLE, "reach": "line_of_sight"},
}
"""Words after a task's name → settings of the channel; the first carries everything."""


def tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks."""
    worlds = {name: SCENARIOS[name] for name in (QUICK_NAMED if quick else NAMED)}
    if not quick:
        worlds["warehouse"] = in_world(SCENARIOS["office"], "warehouse")
    starts = QUICK_STARTS if quick else STARTS
    by_signal = SCENARIOS[BY_SIGNAL]
    channels = tuple(
        task_in(team_name(name, robots) + words, scenario, starts, robots=robots, channel=channel)
        for name, scenario in worlds.items()
        for words, channel in CHANNELS.items()
        for robots in (SIZE_OF_WORSE_CHANNELS if words else SIZES)
    )
    return (*channels, task_in(team_name(BY_SIGNAL, by_signal.robots), by_signal, starts))
