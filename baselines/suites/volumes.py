"""3-D worlds and the office, one robot and three, as the scenarios stand, until a map is known.

Building 079 ends when half of it is seen: its voxels are small and many, and mapping all takes robots hours.
"""

from __future__ import annotations

from baselines.strategies.table import suite_names
from baselines.suites.bundled_worlds import in_world
from baselines.suites.suite import QUICK_STARTS, STARTS, TIME, TIME_90, Task, task_in, team_name
from entropy_explore_env.settings.scenarios import SCENARIOS

TITLE = "Volumes and offices: until the map is known"
MEASURES = (TIME, TIME_90)
STRATEGIES = suite_names("volumes")
NAMED = ("room", "room-furnished", "office", "office-3d", "cave", "terrain")
TEAMS = (1, 3)
HALF = {"seen_share": 0.5, "time_limit_s": 14_400.0}
QUICK_NAMED = 3


def tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks."""
    worlds = {name: SCENARIOS[name] for name in (NAMED[:QUICK_NAMED] if quick else NAMED)}
    if not quick:
        worlds["geb079"] = in_world(SCENARIOS["office-3d"], "geb079", {"ending": HALF})
    return tuple(
        task_in(team_name(name, robots), scenario, QUICK_STARTS if quick else STARTS, robots=robots)
        for name, scenario in worlds.items()
        for robots in TEAMS
    )
