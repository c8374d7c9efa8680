"""Scenarios and world files of one's own as tasks, in place of a suite.

A world file is explored by ground robots (those of `office`) if it is a plan, else by flying ones (those of
`room`), unless another scenario is named.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from baselines.cli.task_options import (
    BaseTask,
    TaskOptions,
    base_task,
    is_whole_scenario,
    options_for,
    tasked,
)
from baselines.experiments.mission import Surroundings, scripted_env
from baselines.suites.suite import Place, Task, team_name
from entropy_explore_env.errors import EntropyExploreError, SettingError, WorldError, one_of
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import SCENARIOS, find_scenario
from entropy_explore_env.settings.validation import checked_path
from entropy_explore_env.worlds.formats import FORMATS
from entropy_explore_env.worlds.given import GIVEN, distinct_names
from entropy_explore_env.worlds.public.table import PUBLIC

DEFAULT_SCENARIOS, QUICK_SCENARIOS = "room,room-furnished,lab,office,cave", "room,office"
MOST_ROBOTS = 1000


def _read_by(*readers: str) -> tuple[str, ...]:
    """Return the suffixes of the files that some readers of the library read."""
    return tuple(suffix for suffix, form in FORMATS.items() if form.reader in readers)


_IMAGES, _YAML = _read_by("images"), _read_by("map_server")
_PLANS = (*_YAML, *_IMAGES)
_MESHES, _CLOUDS = _read_by("meshes"), _read_by("point_clouds", "las")
_HEIGHTS = _read_by("geotiff", "archives", "esri_grid")
_READ_BY_SOME = {
    "height_m": _PLANS,
    "resolution_m": _IMAGES,
    "negate": _IMAGES,
    "occupied_below": _PLANS,
    "free_above": _PLANS,
    "map_rule": _YAML,
    "elevation_step_m": _IMAGES,
    "clearance_m": (*_HEIGHTS, *_MESHES),
    "ceiling_m": _HEIGHTS,
    "hollow": _MESHES,
    "inside": _MESHES,
    "scale": (*_MESHES, *_CLOUDS),
    "gap_m": _CLOUDS,
    "up": (*_MESHES, *_CLOUDS),
}
"""Option of reading → the files that it is for; of several files the others are read without it."""


def scenario_tasks(
    names: str | None, given: Mapping[str, Any], robots: str, missions: int
) -> tuple[Task, ...]:
    """Return a task for each scenario and team size.

    Args:
        names: Names of scenarios, commas between; None = the scenario that the settings hold as a whole.
        given: What the command line gives of TaskOptions, as `given_values` has it.
        robots: Team sizes, commas between.
        missions: Number of missions of a task.

    Raises:
        SettingError: An option is not allowed.
        WorldError: A world file cannot be used.
    """
    asked = [None] if names is None else names.split(",")
    if len(set(asked)) < len(asked):
        raise SettingError("scenarios", names, "each name once")
    tasks = []
    for name in asked:
        if name is not None and name not in SCENARIOS:
            allowed = f"{one_of(name, SCENARIOS)}; world files are given with --world"
            raise SettingError("scenarios", name, allowed)
        base = base_task(name or "room", given.get("settings"))
        tasks += _team_tasks(base, options_for(base, given), robots, missions)
    return tuple(tasks)


def world_tasks(
    world_scenario: str | None, given: Mapping[str, Any], robots: str, missions: int
) -> tuple[tuple[Task, ...], list[str]]:
    """Return a task for each world file and team size, and why files are refused.

    Args:
        world_scenario: Name of the scenario that gives robots, sensor and voxel size.
        given: As in `scenario_tasks`; its worlds are the files, or folders of them.
        robots: Team sizes, commas between.
        missions: Number of missions of a task.

    Raises:
        SettingError: An option is not allowed, or a folder holds no world file.
        WorldError: No file can be used.
    """
    files = [file for path in given["world"] for file in world_files(checked_path("world", path))]
    tasks: list[Task] = []
    refused: list[EntropyExploreError] = []
    for name, file in zip(distinct_names(files), files, strict=True):
        scenario = find_scenario(world_scenario or ("office" if is_plan(file) else "room"))
        base = base_task(dataclasses.replace(scenario, name=name), given.get("settings"))
        chosen = _for_file(options_for(base, given), file, alone=len(files) == 1)
        try:
            tasks += _team_tasks(base, chosen, robots, missions)
        except (WorldError, SettingError) as error:
            if len(files) == 1 or not (isinstance(error, WorldError) or str(file) in str(error)):
                raise
            refused.append(error)
    if not tasks:
        raise refused[0]
    return tuple(tasks), [str(error) for error in refused]


def _for_file(options: TaskOptions, file: Path, alone: bool) -> TaskOptions:
    """Return the options of one file; beside other files without the ways of reading that are not for it."""
    foreign = (
        () if alone else (name for name, kinds in _READ_BY_SOME.items() if file.suffix.lower() not in kinds)
    )
    reading = dataclasses.replace(options.world_file, **{name: None for name in foreign})  # type: ignore[arg-type]
    return dataclasses.replace(options, world=(str(file),), world_file=reading)


def _team_tasks(base: BaseTask, options: TaskOptions, robots: str, missions: int) -> list[Task]:
    """Return the tasks of a scenario, one for each team size."""
    tasks = []
    for size in team_sizes(robots):
        scenario, around = tasked(with_settings(base.scenario, {"track_truth": True}), options, size)
        if around.worlds:
            there = scripted_env(scenario, around).scenario
            scenario = dataclasses.replace(scenario, world=there.world, grid=there.grid)
            if there.world != GIVEN:  # one file alone is a setting of the scenario
                around = dataclasses.replace(around, worlds="")
        if scenario.ending.time_limit_s == math.inf:
            raise SettingError("time_limit_s", math.inf, "finite, so that every mission ends")
        place = Place(
            scenario.name, scenario, missions, surroundings=None if around == Surroundings() else around
        )
        tasks.append(Task(team_name(scenario.name, size), (place,)))
    return tasks


def team_sizes(words: str) -> tuple[int, ...]:
    """Return team sizes from numbers with commas between them.

    Raises:
        SettingError: They are not different whole numbers.
    """
    sizes = tuple(int(word) for word in words.split(",") if word.isascii() and word.isdigit())
    distinct = len(set(sizes)) == len(sizes) == len(words.split(","))
    if not distinct or not all(1 <= size <= MOST_ROBOTS for size in sizes):
        allowed = f"different whole numbers from 1 to {MOST_ROBOTS}, commas between"
        raise SettingError("robots", words, allowed)
    return sizes


def default_sizes(options: TaskOptions, quick: bool) -> str:
    """Return the team sizes that are run where none are given."""
    if is_whole_scenario(options.settings):
        return str(base_task("room", options.settings).scenario.robots)
    return "1,2" if quick else "1,2,4"


def is_plan(path: Path) -> bool:
    """Return whether a file or a public world is a floor plan, which ground robots explore."""
    if str(path) in PUBLIC:
        return PUBLIC[str(path)].grid.flat
    return path.suffix.lower() in _PLANS


def world_files(path: Path) -> list[Path]:
    """Return a world file, or those of a folder; an image that a map_server file names is no world.

    Raises:
        SettingError: There are none.
    """
    if not path.is_dir():
        return [path]
    found = sorted(each for each in path.rglob("*") if each.suffix.lower() in FORMATS)
    named = {each.with_suffix("") for each in found if each.suffix.lower() in _YAML}
    files = [
        each for each in found if each.suffix.lower() not in _IMAGES or each.with_suffix("") not in named
    ]
    if not files:
        raise SettingError("world", str(path), "a file, or a folder with world files: " + " ".join(FORMATS))
    return files
