"""The task on a command line: one definition of the options for commands that run missions.

A scenario, a named one or a file of settings, and what is changed of it: worlds, starts, robots, sensor,
channel, fiducials, ending. A command parses its words once; options that they do not give have the values of
each scenario that it runs, whatever default the help shows.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple, Protocol, TypeVar

from baselines.cli.arguments import given_values, overlaid
from baselines.cli.options import Mark
from baselines.cli.world_options import Reading
from baselines.experiments.mission import Surroundings
from entropy_explore_env.command import allow_read_memory, home_path, is_file
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.channel import Channel
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.fiducials import Fiducials
from entropy_explore_env.settings.json import dataclass_of, scenario_of, settings_of
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import ROOM, SCENARIOS, find_scenario
from entropy_explore_env.settings.sensor import RangeSensor

_WHOLE = ("name", "grid")
"""Settings of a file that is a scenario of its own, and no change of a named one."""
_WITHIN = ("settings", "scenario")
"""Where mission.json and policy.json hold a scenario."""
_POSES = "JSON, or a file of it: for each robot [x, y, z, yaw, pitch], or [x, y, yaw] if it is planar"


@dataclass
class TaskOptions:
    """The task of the missions; defaults are those of the scenario."""

    settings: str | None = None
    """Scenario as JSON, or a file of it such as a mission.json: all of its settings, or some that change the
    named scenario. Options change it further."""
    world: tuple[str, ...] = ()
    """World files or public worlds, dealt to missions in turn. `python -m entropy_explore_env worlds list`
    shows what there is."""
    voxel_size_m: float | None = None
    """Size to which the voxels of world files are resampled; default: the scenario's."""
    world_file: Annotated[Reading, Mark.INLINE] = field(default_factory=Reading)
    world_number: int | None = None
    """Number of a world of the scenario's recipe; default: drawn by the seed."""
    split: Literal["train", "validation", "test"] = "train"
    """Worlds of the recipe that are drawn: those of training, validation or test."""
    starts: str | None = None
    """Poses of all robots as JSON, or a file of it: [[x, y, z, yaw, pitch], ...] in metres and radians, for
    planar robots also [x, y, yaw]; default: drawn by the seed."""
    start_radius_m: float = ROOM.start_radius_m
    """Largest distance of a robot's start from that of the first one."""
    decision_period_s: float | None = None
    """Length of a step; default: until the next robot has to decide."""
    extra_kinds: str | None = None
    """Further kinds of robots as JSON, or a file of it: [{"robot": {"reach_m": 2}, "sensor": {}}, ...]."""
    robot: Robot = field(default_factory=Robot)
    sensor: RangeSensor = field(default_factory=RangeSensor)
    channel: Channel = field(default_factory=Channel)
    fiducials: Fiducials = field(default_factory=Fiducials)
    ending: Ending = field(default_factory=Ending)
    time_limit_s: float | None = None
    """Simulated seconds until a mission is cut off; short for --ending.time-limit-s."""


class TaskArguments(Protocol):
    """The arguments of a command that runs missions; a dataclass."""

    task: TaskOptions


Arguments = TypeVar("Arguments", bound=TaskArguments)


class BaseTask(NamedTuple):
    """The task before the options of a command change it."""

    scenario: Scenario
    decision_period_s: float | None
    """That a file of settings asks for; None = as soon as a robot has to decide."""

    def defaults(self) -> TaskOptions:
        """Return the options whose values are the task's own."""
        scenario = self.scenario
        return TaskOptions(
            split=scenario.split,
            start_radius_m=scenario.start_radius_m,
            decision_period_s=self.decision_period_s,
            robot=scenario.robot,
            sensor=scenario.sensor,
            channel=scenario.channel,
            fiducials=scenario.fiducials,
            ending=scenario.ending,
        )


def base_task(
    name: str | Scenario,
    settings: str | None = None,
    own: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
) -> BaseTask:
    """Return the named scenario with the settings of a file, or the scenario that the file holds as a whole.

    Args:
        name: Of a scenario, or a Scenario.
        settings: JSON, or a file of it: settings of a Scenario, or an object with these under `settings` or
            `scenario`.
        own: Settings that a command changes in named scenarios, part by part; those of a file come after.

    Raises:
        SettingError: No scenario has the name, or the file holds no settings of one.
    """
    if settings is None:
        return BaseTask(with_settings(find_scenario(name), own), None)
    given = settings_in(settings)
    if not is_whole_scenario(settings):
        named = with_settings(find_scenario(name), own)
        given = _merged(settings_of(named) | {"decision_period_s": None}, given)
    scenario = scenario_of({"decision_period_s": None, **given})
    return BaseTask(scenario, scenario.decision_period_s)


def is_whole_scenario(settings: str | None) -> bool:
    """Return whether a file of settings is a scenario of its own, and changes no named one.

    Raises:
        SettingError: It holds no settings of a scenario.
    """
    given = {} if settings is None else settings_in(settings)
    return all(name in given for name in _WHOLE)


def settings_in(file: str) -> Mapping[str, Any]:
    """Return the object of settings in a file, or in a text that is one."""
    allowed = "a file with a scenario's settings as JSON"
    try:
        inline = file.lstrip().startswith("{")
        given = json.loads(file if inline else home_path(file).read_text("utf-8"))
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
    """Return settings with some changed, in parts too."""
    merged = dict(settings)
    for name, value in changes.items():
        inner = merged.get(name)
        if isinstance(inner, Mapping) and isinstance(value, Mapping):
            merged[name] = _merged(inner, value)
        else:
            merged[name] = value
    return merged


def parsed_for(task: BaseTask, args: Arguments, words: Sequence[str], **more: object) -> Arguments:
    """Return a command's arguments where what is not given is the task's own.

    Args:
        task: The task.
        args: As they were parsed, of whatever task; its `task` is replaced.
        words: The command line.
        **more: Further fields whose defaults the task says.
    """
    given = given_values(type(args), words)
    others = {name: value for name, value in more.items() if name not in given}
    options = options_for(task, given.get("task", {}))
    return dataclasses.replace(args, task=options, **others)  # type: ignore[type-var]


def options_for(task: BaseTask, given: Mapping[str, Any]) -> TaskOptions:
    """Return a task's own options, changed by what `given_values` found of TaskOptions."""
    return overlaid(task.defaults(), given)


def tasked(
    scenario: Scenario, options: TaskOptions, robots: int | None = None
) -> tuple[Scenario, Surroundings]:
    """Return the scenario with the options of a command line, and what of a mission is no setting of it.

    Args:
        scenario: What to start from.
        options: Of the command.
        robots: Team size; None = the scenario's.

    Raises:
        SettingError: An option is not allowed.
        WorldError: A world file cannot be used.
    """
    ending = dataclasses.replace(options.ending, time_limit_s=limit_s(options))
    names = ("split", "start_radius_m", "decision_period_s", "robot", "sensor")
    names += ("channel", "fiducials")
    settings: dict[str, Any] = {"ending": ending, **{name: getattr(options, name) for name in names}}
    if robots is not None:
        settings["robots"] = robots
        if scenario.name in SCENARIOS and scenario.reward == SCENARIOS[scenario.name].reward:
            settings["reward"] = find_scenario(scenario.name, robots).reward
    if options.extra_kinds is not None:
        settings["extra_kinds"] = _kinds(options.extra_kinds)
    worlds = worlds_of(options)
    changed = with_settings(scenario, settings)
    there = EntropyExploreEnv(changed, **worlds).scenario if worlds else changed  # refuses a wrong file
    fixed = reset_options(options.starts, options.world_number, there)
    surroundings = Surroundings(
        json.dumps(worlds) if worlds else "", json.dumps(fixed) if fixed else "", options.decision_period_s
    )
    return changed, surroundings


def _kinds(words: str) -> tuple[RobotKind, ...]:
    """Return the kinds of robots from JSON, or from a file of it."""
    allowed = "JSON, or a file of it: a list of objects with robot and sensor"
    kinds = given_json("extra_kinds", words, allowed)
    if not isinstance(kinds, list):
        raise SettingError("extra_kinds", words, allowed)
    return tuple(dataclass_of(RobotKind, kind, f"extra_kinds[{place}]") for place, kind in enumerate(kinds))


def limit_s(options: TaskOptions) -> float:
    """Return the simulated time after which a mission is cut off, in seconds."""
    return options.ending.time_limit_s if options.time_limit_s is None else options.time_limit_s


def worlds_of(options: TaskOptions, files: Sequence[str] | None = None) -> dict[str, Any]:
    """Return settings of an environment in the world files of a task; limit the memory that reading takes.

    A single file of which nothing is asked stays a setting of the scenario, which a mission record refers to;
    else the record holds the world.

    Args:
        options: Of the command.
        files: In place of the options' own.

    Raises:
        SettingError: An option of world files is given without a file.
    """
    reading = options.world_file
    worlds = list(options.world if files is None else files)
    size = {} if options.voxel_size_m is None else {"voxel_size_m": options.voxel_size_m}
    if not worlds:
        for name, value in (size | reading.asked()).items():
            raise SettingError(name, value, "--world beside it")
        return {}
    if reading.read_memory_mib is not None:
        allow_read_memory(reading.read_memory_mib)  # of this process: no setting of a mission
        reading = dataclasses.replace(reading, read_memory_mib=None)
    if len(worlds) > 1 or reading.asked():
        path = worlds[0] if len(worlds) == 1 else worlds
        return {"world": {"path": path, **size, **reading.options()}}
    return {"world": worlds[0], **({"grid": size} if size else {})}


def reset_options(starts: str | None, world_number: int | None, scenario: Scenario) -> dict[str, Any]:
    """Return the options of `reset` from a command line.

    Args:
        starts: JSON text (it begins with a bracket), or the path of a file that holds it: a list of A poses,
            metres and radians in the map frame; None = drawn.
        world_number: Of the scenario's split; None = drawn.
        scenario: The task, whose planar robots' poses may be [x, y, yaw].

    Raises:
        SettingError: The text is no list of poses, or the file cannot be read.
    """
    options: dict[str, Any] = {} if world_number is None else {"world": world_number}
    if starts is not None:
        poses = given_json("starts", starts, _POSES)
        if not isinstance(poses, list) or not all(isinstance(pose, list) for pose in poses):
            raise SettingError("starts", starts, _POSES)
        options["starts"] = [_full_pose(scenario, robot, pose) for robot, pose in enumerate(poses)]
    return options


def given_json(option: str, given: str, allowed: str) -> Any:  # noqa: ANN401 - whatever the text holds
    """Return what a text of JSON (it begins with a bracket), or the file of this name, holds.

    Raises:
        SettingError: It is neither.
    """
    text = given
    if not given.lstrip().startswith("["):
        try:
            text = home_path(given).read_text("utf-8")
        except (OSError, ValueError):
            raise SettingError(option, given, allowed) from None
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise SettingError(option, given, allowed) from None


def _full_pose(scenario: Scenario, robot: int, pose: list[Any]) -> list[Any]:
    """Return a pose of five numbers; [x, y, yaw] is that of a planar robot in its plane, level."""
    if len(pose) != 3 or robot >= scenario.robots:
        return pose
    plane_m = scenario.plane_m(robot)
    if plane_m is None:
        raise SettingError(f"starts[{robot}]", pose, "[x, y, z, yaw, pitch]: this robot flies")
    x, y, yaw = pose
    return [x, y, plane_m, yaw, 0.0]


def settled(options: TaskOptions) -> TaskOptions:
    """Return the same options wherever and whenever they are read: absolute paths, files of JSON as texts.

    Raises:
        SettingError: A file does not hold what it should.
    """
    texts = {
        name: json.dumps(given_json(name, given, "JSON, or a file of it"))
        for name in ("starts", "extra_kinds")
        if (given := getattr(options, name)) is not None
    }
    if options.settings is not None:
        texts["settings"] = json.dumps(settings_in(options.settings))
    return dataclasses.replace(options, world=absolute_files(options.world), **texts)


def absolute_files(files: Iterable[str]) -> tuple[str, ...]:
    """Return the world files as absolute paths; a name that is no file stays."""
    return tuple(str(home_path(file).absolute()) if is_file(file) else file for file in files)
