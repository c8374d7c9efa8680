"""The task of an Explorer: how its robots move, what they sense and what is to be seen."""

from __future__ import annotations

import dataclasses
from typing import Any

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import OFFICE, find_scenario
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.settings.validation import is_number

_DEFAULT = dataclasses.replace(OFFICE, name="explorer", ending=Ending(seen_share=1.0, sigma_end=0.5))
"""Ground robots with a scanner that are to see everything."""


def task_of(
    scenario: str | Scenario | None,
    robots: int | None,
    robot: Robot | None,
    sensor: RangeSensor | None,
    voxel_size_m: float | None,
) -> Scenario:
    """Return the task that settings of an Explorer describe; see there.

    Its grid is the scenario's. Without a scenario, or with a voxel size of its own, the grid is one in which
    the task can be checked before there is a map.

    Raises:
        SettingError: A setting is not allowed.
    """
    base = _DEFAULT if scenario is None else find_scenario(scenario, robots)
    count = 1 if robots is None and scenario is None else robots
    parts = {"robots": count, "robot": robot, "sensor": sensor}
    changes: dict[str, Any] = {name: value for name, value in parts.items() if value is not None}
    if scenario is None or voxel_size_m is not None:
        changes["grid"] = _nominal_grid(base, robot, voxel_size_m)
    return with_settings(base, {**changes, "action": {"kind": "continuous"}})


def _nominal_grid(base: Scenario, robot: Robot | None, voxel_size_m: float | None) -> Grid:
    """Return a grid that is large enough for the bodies of a task."""
    size_m = base.grid.voxel_size_m if voxel_size_m is None else voxel_size_m
    if not is_number(size_m) or not 1e-6 <= size_m <= 1e6:
        raise SettingError("voxel_size_m", size_m, "a number from 1e-6 to 1e6")
    bodies = [robot or base.robot, *(kind.robot for kind in base.extra_kinds)]
    widest_m = max(1.0, *(4.0 * body.body_radius_m for body in bodies))
    highest_m = max(body.sensor_height_m for body in bodies)
    wide, high = (int(length_m / size_m) + 2 for length_m in (widest_m, highest_m))
    return Grid((wide, wide, high), float(size_m))
