"""The task on a command line: one definition of the options for commands that run missions.

A scenario, a named one or a file of settings, and what is changed of it: worlds, starts, robots, sensor,
channel, ending. Options that are not given have the scenario's own values, which the help shows.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

from baselines.cli.arguments import OmitArgPrefixes, parse
from baselines.cli.start_options import given_json, reset_options
from baselines.cli.world_options import Reading, world_settings
from baselines.experiments.mission import Surroundings
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import ROOM, find_scenario
from entropy_explore_env.settings import Channel, Ending, RangeSensor, Robot, RobotKind
from entropy_explore_env.settings_json import dataclass_of, scenario_of, settings_of

_WHOLE = ("name", "grid")
"""Settings of a file that is a scenario of its own, and no change of a named one."""
_WITHIN = ("settings", "scenario")
"""Where mission.json and policy.json hold a scenario."""


@dataclass
class TaskOptions:
    """What missions are run; the defaults are a scenario's."""

    settings: str | None = None
    """A file with a scenario as JSON, whole or some of its settings, which change the named scenario; a
    mission.json, too. Options change it further."""
    world: tuple[str, ...] = ()
    """World files in place of the scenario's worlds, dealt to missions in turn by their seeds;
    entropy_explore_env.worlds lists the kinds."""
    voxel_size_m: float | None = None
    """Resample the world files' voxels to this size; default: the scenario's."""
    world_file: OmitArgPrefixes[Reading] = field(default_factory=Reading)
    world_number: int | None = None
    """The world with this number of the scenario's recipe; default: drawn by the seed."""
    split: Literal["train", "validation", "test"] = "train"
    """Which worlds of the recipe: those of training, validation or test."""
    starts: str | None = None
    """Poses of all robots as JSON, or a file of it: [[x, y, z, yaw, pitch], ...] in metres and radians,
    of planar robots also [x, y, yaw]; default: drawn by the seed."""
    start_radius_m: float = ROOM.start_radius_m
    """Robots start at most so far from where the first one does."""
    decision_period_s: float | None = None
    """Length of a step in seconds; default: until the next robot has to decide."""
    extra_kinds: str | None = None
    """Further kinds of robots as JSON, or a file of it: [{"robot": {"reach_m": 2}, "sensor": {}}, ...]."""
    robot: Robot = field(default_factory=Robot)
    sensor: RangeSensor = field(default_factory=RangeSensor)
    channel: Channel = field(default_factory=Channel)
    ending: Ending = field(default_factory=Ending)
    time_limit_s: float | None = None
    """Short for --ending.time-limit-s."""


Arguments = TypeVar("Arguments")


class BaseTask(NamedTuple):
    """The task before the options of a command change it."""

    scenario: Scenario
    decision_period_s: float | None
    """That a file of settings asks for; None = as soon as a robot has to decide."""

    def defaults(self, settings: str | None = None) -> TaskOptions:
        """The options whose values are the task's own."""
        scenario = self.scenario
        return TaskOptions(
            settings=settings,
            split=scenario.split,
            start_radius_m=scenario.start_radius_m,
            decision_period_s=self.decision_period_s,
            robot=scenario.robot,
            sensor=scenario.sensor,
            channel=scenario.channel,
            ending=scenario.ending,
        )


def base_task(name: str | Scenario, settings: str | None = None) -> BaseTask:
    """The named scenario with the settings of a file, or the scenario that the file holds as a whole.

    Args:
        name: Of a scenario, or a Scenario.
        settings: JSON: settings of a Scenario, or an object with these under `settings` or `scenario`.

    Raises:
        SettingError: No scenario has the name, or the file holds no settings of one.
    """
    if settings is None:
        return BaseTask(find_scenario(name), None)
    given = _settings_in(settings)
    if not all(field in given for field in _WHOLE):
        given = _merged(settings_of(find_scenario(name)) | {"decision_period_s": None}, given)
    scenario = scenario_of({"decision_period_s": None, **given})
    return BaseTask(scenario, scenario.decision_period_s)


def _settings_in(file: str) -> Mapping[str, Any]:
    """The object of settings in a file."""
    allowed = "a file with a scenario's settings as JSON"
    try:
        given = json.loads(Path(file).expanduser().read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingError("settings", file, f"{allowed} ({reason})") from None
    for name in _WITHIN:
        if isinstance(given, Mapping) and isinstance(given.get(name), Mapping):
            return given[name]
    if not isinstance(given, Mapping):
        raise SettingError("settings", file, f"{allowed}: an object")
    return given


def _merged(settings: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Settings with some changed, in parts too."""
    merged = dict(settings)
    for name, value in changes.items():
        inner = merged.get(name)
        if isinstance(inner, Mapping) and isinstance(value, Mapping):
            merged[name] = _merged(inner, value)
        else:
            merged[name] = value
    return merged


def parsed_for(
    task: BaseTask, default: Arguments, words: Sequence[str], description: str | None, **more: object
) -> Arguments:
    """A command's arguments where what is not given is the task's own.

    Args:
        task: The task.
        default: The command's arguments as already parsed or by default; its `task` is replaced.
        words: Of the command line.
        description: The first line of the help.
        **more: Further fields whose defaults the task says.

    Raises:
        UsageError: The words do not fit.
    """
    settings = getattr(default, "task").settings  # noqa: B009 - of any dataclass with a task
    start = dataclasses.replace(default, task=task.defaults(settings), **more)  # type: ignore[type-var]
    return parse(type(default), words, default=start, description=description)


def tasked(
    scenario: Scenario, options: TaskOptions, robots: int | None = None
) -> tuple[Scenario, Surroundings]:
    """The scenario with the options of a command line, and what of a mission is no setting of it.

    Args:
        scenario: What to start from.
        options: Of the command.
        robots: Team size; None = the scenario's.

    Raises:
        SettingError: An option is not allowed.
        WorldError: A world file cannot be used.
    """
    ending = options.ending
    if options.time_limit_s is not None:
        ending = dataclasses.replace(ending, time_limit_s=options.time_limit_s)
    names = ("split", "start_radius_m", "decision_period_s", "robot", "sensor", "channel")
    settings: dict[str, Any] = {"ending": ending, **{name: getattr(options, name) for name in names}}
    if robots is not None:
        settings["robots"] = robots
    if options.extra_kinds is not None:
        settings["extra_kinds"] = _kinds(options.extra_kinds)
    worlds = world_settings(options.world, options.voxel_size_m, options.world_file)
    changed = with_settings(scenario, settings)
    there = EntropyExploreEnv(changed, **worlds).scenario if worlds else changed  # refuses a wrong file
    fixed = reset_options(options.starts, options.world_number, there)
    surroundings = Surroundings(
        json.dumps(worlds) if worlds else "", json.dumps(fixed) if fixed else "", options.decision_period_s
    )
    return changed, surroundings


def _kinds(words: str) -> tuple[RobotKind, ...]:
    """Kinds of robots from JSON, or from a file of it."""
    allowed = "JSON, or a file of it: a list of objects with robot and sensor"
    kinds = given_json("extra_kinds", words, allowed)
    if not isinstance(kinds, list):
        raise SettingError("extra_kinds", words, allowed)
    return tuple(dataclass_of(RobotKind, kind, f"extra_kinds[{place}]") for place, kind in enumerate(kinds))
