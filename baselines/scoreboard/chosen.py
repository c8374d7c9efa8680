"""What a user chooses: strategies by name, and scenarios of one's own in place of a suite."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from baselines.cli.task_options import BaseTask, TaskOptions, tasked
from baselines.experiments.mission import Surroundings, scripted_env
from baselines.scoreboard.results import BASELINE, REFERENCE
from baselines.scoreboard.suites import Place, Task, suite_strategies, team_name
from baselines.strategies import STRATEGIES, make_strategy, resolved
from baselines.world_sweep import is_plan
from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import SCENARIOS, find_scenario
from entropy_explore_env.worlds.given import GIVEN, distinct_names

_WHOLE_SUITE = "suite"
"""In place of a name: those that stand in the suite's table."""


def chosen_strategies(words: str | None, suite: str | None = None) -> tuple[str, ...]:
    """Strategies from names with commas between them.

    Args:
        words: Names; `all` = every one; `suite`, also beside other names, or None = those of the suite's
            table; None without a suite = every one.
        suite: Its name; the strategy that ratios are relative to is added, without a suite the
            random walk is.

    Raises:
        SettingError: No strategy, or no suite, has such a name.
    """
    if words is None and suite is not None:
        words = _WHOLE_SUITE
    names = list(STRATEGIES) if words in (None, "all") else words.split(",")
    if suite is not None and _WHOLE_SUITE in names:
        at = names.index(_WHOLE_SUITE)
        names[at : at + 1] = suite_strategies(suite)
    for name in names:
        make_strategy(name)
    added = BASELINE if suite is None else REFERENCE
    return tuple(dict.fromkeys([added, *map(resolved, names)]))


class Entry(NamedTuple):
    """A scenario that strategies are compared in, before options change it."""

    scenario: str | Scenario
    file: str | None = None
    """A world file, in place of the scenario's worlds."""


class Mission(NamedTuple):
    """What is run in an entry with a team size."""

    scenario: Scenario
    surroundings: Surroundings


def own_tasks(missions: Mapping[str, Sequence[Mission]], seeds: int) -> tuple[Task, ...]:
    """A task for each name and team size, in worlds of the scenario's split.

    Args:
        missions: Name of an entry → a mission for each team size.
        seeds: Missions of each strategy.
    """
    return tuple(
        Task(
            team_name(name, scenario.robots),
            (Place(name, scenario, seeds, surroundings=around if around != Surroundings() else None),),
        )
        for name, teams in missions.items()
        for scenario, around in teams
    )


def chosen_entries(words: str, world_scenario: str | None) -> dict[str, Entry]:
    """Scenarios from names and paths of world files with commas between them.

    Args:
        words: Names and paths.
        world_scenario: Name of the scenario that gives robots, sensors and voxel size for the files; None =
            `office` for plans, `room` for other worlds.

    Returns:
        Name → entry; the name of a file is without suffix, with as many of its folders as tell it apart.

    Raises:
        SettingError: A name is unknown or given twice.
    """
    given = words.split(",")
    files = [word for word in given if word not in SCENARIOS]
    names = dict(zip(files, distinct_names([Path(file) for file in files]), strict=True))
    chosen: dict[str, Entry] = {}
    for word in given:
        name = names.get(word, word)
        if name in chosen:
            raise SettingError("scenarios", words, f"each name once, not {name} twice")
        chosen[name] = _file_entry(word, name, world_scenario) if word in names else Entry(word)
    return chosen


def _file_entry(word: str, name: str, world_scenario: str | None) -> Entry:
    path = Path(word)
    if not path.is_file():
        raise SettingError("scenarios", word, f"a world file that is there, or {one_of(word, SCENARIOS)}")
    base = find_scenario(world_scenario or ("office" if is_plan(path) else "room"))
    return Entry(dataclasses.replace(base, name=name), word)


def entry_mission(entry: Entry, task: BaseTask, options: TaskOptions, robots: int) -> Mission:
    """The mission of an entry with a team size, scored.

    Args:
        entry: The scenario.
        task: What the options change.
        options: Of the command.
        robots: Team size.

    Raises:
        SettingError: An option is not allowed.
        WorldError: A world file cannot be used.
    """
    if entry.file is not None:
        if options.world:
            raise SettingError("world", list(options.world), f"left out: {entry.file} is a world itself")
        options = dataclasses.replace(options, world=(entry.file,))
    scenario, around = tasked(with_settings(task.scenario, {"track_truth": True}), options, robots)
    if around.worlds:
        there = scripted_env(scenario, around).scenario
        scenario = dataclasses.replace(scenario, world=there.world, grid=there.grid)
        if there.world != GIVEN:  # one file alone is a setting of the scenario
            around = dataclasses.replace(around, worlds="")
    return Mission(scenario, around)
