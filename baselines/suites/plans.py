"""Floor plans: one ground robot that replans at every scan under way, until all that can be seen is seen.

The dungeons are those of ARiADNE (Cao et al., ICRA 2023): a sensor of 80 cells, a robot without a body, the
start mark as start, and the end when at most 250 free cells are unseen. In the other plans robots have no
body either, so that all cells can be seen. The lidar has 720 rays, as the dungeons' authors have it and as
real ones have: the 180 of the scenarios leave single cells unknown between them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from baselines.strategies.table import suite_names
from baselines.suites.bundled_worlds import dungeons, in_world
from baselines.suites.suite import PATH, QUICK_STARTS, STARTS, TIME_99, Place, Task, task_in
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS

TITLE = "Plans: until everything is seen"
MEASURES = (PATH, TIME_99)
STRATEGIES = suite_names("plans")
NAMED = ("office", "corridor", "cluttered", "hybrid")
FILES = ("depot", "warehouse", "willow")
SCAN_EVERY_M = 0.5
ANGULAR_STEP_RAD = math.pi / 360
TIME_LIMIT_S = 7200.0
DUNGEON_UNSEEN = 250
QUICK_NAMED, QUICK_DUNGEONS = 2, 2


def tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks."""
    starts = QUICK_STARTS if quick else STARTS
    chosen = {name: SCENARIOS[name] for name in (NAMED[:QUICK_NAMED] if quick else NAMED)}
    if not quick:
        chosen |= {name: in_world(SCENARIOS["office"], name) for name in FILES}
    return (
        dungeon_task(QUICK_DUNGEONS if quick else None),
        *(
            task_in(name, explored(scenario, {"seen_share": 1.0}), starts)
            for name, scenario in chosen.items()
        ),
    )


def explored(scenario: Scenario, ending: Mapping[str, Any]) -> Scenario:
    """Return a scenario with one robot without a body, the suite's lidar, and an end."""
    changes = {
        "robots": 1,
        "robot": {"redecide": "on_scan", "body_radius_m": 0.0},
        "sensor": {"scan_every_m": SCAN_EVERY_M, "angular_step_rad": ANGULAR_STEP_RAD},
        "ending": {**ending, "time_limit_s": TIME_LIMIT_S},
    }
    return with_settings(scenario, changes)


def dungeon_task(count: int | None) -> Task:
    """Return the task of the first dungeons; None = of all."""
    chosen = dungeons()[:count]
    far = {"robot": {"reach_m": 8.0}, "sensor": {"max_range_m": 8.0}, "track_truth": True}
    base = with_settings(explored(SCENARIOS["office"], {"unseen_free_voxels": DUNGEON_UNSEEN}), far)
    first = in_world(base, f"dungeons/{chosen[0].name}")
    places = (
        Place(each.name, dataclasses.replace(first, name="dungeon", world=each.world), 1, each.start)
        for each in chosen  # all have the same grid
    )
    return Task("dungeons", tuple(places))
