"""Where the robots of a command's mission start, and in which numbered world: options of the reset."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.scenario import Scenario

_ALLOWED = "JSON, or a file of it: for each robot [x, y, z, yaw, pitch], or [x, y, yaw] if it is planar"


def reset_options(starts: str | None, world_number: int | None, scenario: Scenario) -> dict[str, Any]:
    """Options of `reset` from a command line.

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
        poses = given_json("starts", starts, _ALLOWED)
        if not isinstance(poses, list) or not all(isinstance(pose, list) for pose in poses):
            raise SettingError("starts", starts, _ALLOWED)
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
            text = Path(given).expanduser().read_text("utf-8")
        except (OSError, UnicodeDecodeError):
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
