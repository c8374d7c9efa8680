"""The tasks of the scoreboard's suites: plans, volumes, teams and channels, and the other named scenarios.

Plans: one ground robot that replans at every scan under way, until all that can be seen is seen. The dungeons
are those of ARiADNE (Cao et al., ICRA 2023): a sensor of 80 cells, a robot without a body, the start mark as
start, and the end when at most 250 free cells are unseen. In the other plans robots have no body either, so
that all cells can be seen. The lidar has 720 rays, as the dungeons' authors have it and as real ones have;
the 180 of the scenarios leave single cells unknown between them.

Volumes: 3-D worlds and the office as the scenarios stand, until a map is known; building 079, of many small
voxels, until half of it is seen. Teams: their channel carries everything; teams of four also with worse ones.
In `office-signal` robots share by the strength of signals, and each has to get the whole map.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from baselines.suites.public_worlds import in_world
from baselines.suites.suite import QUICK_STARTS, STARTS, Place, Task, task_in, team_name
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.worlds.public.table import PUBLIC

PLANS = ("office", "corridor", "cluttered", "hybrid")
PLAN_FILES = ("depot", "warehouse", "willow")
SCAN_EVERY_M, ANGULAR_STEP_RAD = 0.5, math.pi / 360
PLAN_LIMIT_S = 7200.0
DUNGEON_UNSEEN = 250
_DUNGEON = "dungeon-"
QUICK_PLANS, QUICK_DUNGEONS = 2, 2

VOLUMES = ("room", "room-furnished", "office", "office-3d", "cave", "terrain")
QUICK_VOLUMES = 3
VOLUME_TEAMS = (1, 3)
HALF = {"seen_share": 0.5, "time_limit_s": 14_400.0}

TEAM_WORLDS = ("room-furnished", "office", "office-3d", "cave", "terrain")
QUICK_TEAM_WORLDS = ("office",)
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

OTHERS = (
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
"""Scenarios that no other suite has, as they stand, with their own teams."""
QUICK_OTHERS = ("box-7x11x5", "lab", "bhattacharya-office")


def _starts(quick: bool) -> int:
    return QUICK_STARTS if quick else STARTS


def plan_tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks of plans."""
    chosen = {name: SCENARIOS[name] for name in (PLANS[:QUICK_PLANS] if quick else PLANS)}
    if not quick:
        chosen |= {name: in_world(SCENARIOS["office"], name) for name in PLAN_FILES}
    return (
        _dungeon_task(QUICK_DUNGEONS if quick else None),
        *(
            task_in(name, _explored(scenario, {"seen_share": 1.0}), _starts(quick))
            for name, scenario in chosen.items()
        ),
    )


def _explored(scenario: Scenario, ending: Mapping[str, Any]) -> Scenario:
    """Return a scenario with one robot without a body, the suite's lidar, and an end."""
    changes = {
        "robots": 1,
        "robot": {"redecide": "on_scan", "body_radius_m": 0.0},
        "sensor": {"scan_every_m": SCAN_EVERY_M, "angular_step_rad": ANGULAR_STEP_RAD},
        "ending": {**ending, "time_limit_s": PLAN_LIMIT_S},
    }
    return with_settings(scenario, changes)


def _dungeon_task(count: int | None) -> Task:
    """Return the task of the first dungeons; None = of all."""
    chosen = [name for name in PUBLIC if name.startswith(_DUNGEON)][:count]
    far = {"robot": {"reach_m": 8.0}, "sensor": {"max_range_m": 8.0}, "track_truth": True}
    base = with_settings(_explored(SCENARIOS["office"], {"unseen_free_voxels": DUNGEON_UNSEEN}), far)
    places = []
    for name in chosen:
        scenario = dataclasses.replace(in_world(base, name), name="dungeon")
        places.append(Place(name.removeprefix(_DUNGEON), scenario, 1, _marked_start(name)))
    return Task("dungeons", tuple(places))


def _marked_start(name: str) -> tuple[float, float, float, float, float]:
    """Return the pose at a world's start mark, in the middle of the one layer of voxels."""
    world = PUBLIC[name]
    assert world.start_m is not None
    return (*world.start_m, world.grid.voxel_size_m / 2, 0.0, 0.0)


def volume_tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks of volumes and offices."""
    worlds = {name: SCENARIOS[name] for name in (VOLUMES[:QUICK_VOLUMES] if quick else VOLUMES)}
    if not quick:
        worlds["geb079"] = in_world(SCENARIOS["office-3d"], "geb079", {"ending": HALF})
    return tuple(
        task_in(team_name(name, robots), scenario, _starts(quick), robots=robots)
        for name, scenario in worlds.items()
        for robots in VOLUME_TEAMS
    )


def team_tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks of teams and channels."""
    worlds = {name: SCENARIOS[name] for name in (QUICK_TEAM_WORLDS if quick else TEAM_WORLDS)}
    if not quick:
        worlds["warehouse"] = in_world(SCENARIOS["office"], "warehouse")
    by_signal = SCENARIOS[BY_SIGNAL]
    channels = tuple(
        task_in(team_name(name, robots) + words, scenario, _starts(quick), robots=robots, channel=channel)
        for name, scenario in worlds.items()
        for words, channel in CHANNELS.items()
        for robots in (SIZE_OF_WORSE_CHANNELS if words else SIZES)
    )
    return (*channels, task_in(team_name(BY_SIGNAL, by_signal.robots), by_signal, _starts(quick)))


def other_tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks of the other named scenarios."""
    return tuple(
        task_in(team_name(name, SCENARIOS[name].robots), SCENARIOS[name], _starts(quick))
        for name in (QUICK_OTHERS if quick else OTHERS)
    )
