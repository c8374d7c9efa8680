"""The suite of C²-Explorer's two buildings: one to four drones, and radio of 5 m or without limit.

Speeds, lidar and starts are those of the authors' launch files (Yan et al., IROS 2026). The lidar takes ten
scans a second, in flight as in hovering, and robots in flight decide twice a second. Seeds differ in what
strategies draw. A mission goes on until one robot's own map holds 99 % of what can be seen; on the way it
notes when the joint map holds 95 % and 99 %.
"""

from __future__ import annotations

import json
import math
from typing import NamedTuple

from baselines.experiments.mission import Surroundings
from baselines.suites.public_worlds import in_world
from baselines.suites.suite import TIME, TIME_95, TIME_99, Place, Task, team_name
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import SCENARIOS

MISSIONS, QUICK_MISSIONS = 10, 1
STARTS_M = {
    "octa_maze": ((-14.0, 2.6, 1.0), (-14.0, -2.3, 1.0), (-16.0, 1.0, 1.0), (-16.0, -1.0, 1.0)),
    "cubicle_office": ((-13.5, 0.0, 1.0), (-13.5, -1.0, 1.0), (-13.5, 1.0, 1.0), (-13.5, 2.0, 1.0)),
}
"""World → x, y, z of the drones, which look along x; teams are made of the first ones."""
SIZES = (1, 2, 3, 4)
RADIOS_M = {"": math.inf, ", radio 5 m": 5.0}
"""Words after a task's name → range of the radio."""
MEASURES = (TIME_99, TIME_95, TIME)
_DRONE = {
    "robot": {
        "navigator": "planned",
        "reach_m": 10.0,
        "max_speed_m_s": 2.0,
        "acceleration_m_s2": 2.0,
        "turn_rate_rad_s": math.radians(120.0),
        "body_radius_m": 0.3,
        "redecide": 0.5,
    },
    "sensor": {
        "field_of_view_rad": (2.0 * math.pi, math.radians(55.0)),
        "angular_step_rad": math.pi / 60,
        "max_range_m": 10.0,
        "scan_time_s": 0.1,
        "scan_every_m": 0.2,  # at full speed ten a second
    },
    "ending": {"seen_share": 0.99, "termination": "one", "time_limit_s": 1800.0},
    "track_truth": True,
    "split": "test",
}


class Team(NamedTuple):
    """A team in a world."""

    world: str
    robots: int
    radio: str
    """One of RADIOS_M."""


TEAMS = tuple(
    Team(world, robots, radio)
    for world in STARTS_M
    for radio in RADIOS_M
    for robots in (SIZES if not radio else SIZES[1:])
)
QUICK_TEAMS = (Team("cubicle_office", 4, ""),)


def tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks: a team in a world each."""
    return tuple(
        _task(team, QUICK_MISSIONS if quick else MISSIONS) for team in (QUICK_TEAMS if quick else TEAMS)
    )


def _task(team: Team, missions: int) -> Task:
    """Return the task of a team, which sends everything to whom its radio reaches."""
    channel = {"burst": 1_000_000, "i_min_bits": 0.0, "range_m": RADIOS_M[team.radio]}
    base = in_world(SCENARIOS["office-3d"], team.world, _DRONE)
    scenario = with_settings(base, {"robots": team.robots, "channel": channel})
    starts = [[*place, 0.0, 0.0] for place in STARTS_M[team.world][: team.robots]]
    around = Surroundings(every_reset=json.dumps({"starts": starts}))
    place = Place(team.world, scenario, missions, surroundings=around)
    return Task(team_name(team.world, team.robots) + team.radio, (place,))
