"""Answers of an Explorer, a goal or the reason for having none, and checks of the poses that it is given."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import is_whole

NOTHING_BITS = 1e-6
"""Expected bits up to which a scan brings nothing."""


class Why(enum.Enum):
    """What a goal is for; the value is a sentence for people."""

    EXPLORES = "A scan from there is expected to see what is unknown."
    PASSES = "It lies on the way to what is unknown."
    GIVES_WAY = "The robot makes room for a teammate."
    RETURNS = "Nothing is left to see, and the robot drives back to where it started."


def purpose_of(expected_bits: float, end: MoveEnd) -> Why:
    """Return the purpose of a goal, by what is expected of it and how the drive before ended."""
    if expected_bits > NOTHING_BITS:
        return Why.EXPLORES
    return Why.GIVES_WAY if end is MoveEnd.TEAMMATE else Why.PASSES


class NoGoal(enum.Enum):
    """Why there is no goal; the value is a sentence for people."""

    ALL_SEEN = "Nothing that is known to be free lies beside what is unknown."
    OUT_OF_REACH = "What is unknown cannot be reached, or was looked at in vain."


@dataclass(frozen=True, eq=False)
class Goal:
    """Where a robot goes next.

    Attributes:
        viewpoint: (5,) x, y, z, yaw, pitch, map frame.
        path: (N, 3) points to which to drive straight, one after the other, through what is believed free; it
            ends at the viewpoint, or as near as a path is known.
        expected_bits: Bits that a scan at the viewpoint should bring.
        seconds: Time until that scan is taken.
        why: Purpose of the goal.
    """

    viewpoint: np.ndarray
    path: np.ndarray
    expected_bits: float
    seconds: float
    why: Why


class Decider(Protocol):
    """A strategy: see docs/own_strategy.md. Where it has `choose_all`, that is called with the one view.

    Where the map has outgrown its grid, `grow(scenario, shift)` is called in place of `reset`, if the
    strategy has it: voxel (0, 0, 0) of the grid before has the indices `shift`, (3,) int64, in the new one.
    A Search in the attribute `search` is used as memory between decisions, too.
    """

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin, or begin anew in another grid."""
        ...

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoint (5,) of a robot."""
        ...


def check_decider(strategy: object) -> None:
    """Raise a SettingError unless a strategy is an object that can begin and choose."""
    methods = {name for name in ("reset", "choose", "choose_all") if callable(getattr(strategy, name, None))}
    if isinstance(strategy, type) or "reset" not in methods or len(methods) == 1:
        made = f", such as baselines.strategies.make_strategy({strategy!r})" * isinstance(strategy, str)
        raise SettingError("strategy", strategy, f"an object with reset and choose or choose_all{made}")


def checked_pose(name: str, pose: object) -> np.ndarray:
    """Return a pose as an array.

    Raises:
        SettingError: It is not five finite numbers.
    """
    try:
        array = np.array(pose, np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (5,) or not np.isfinite(array).all():
        raise SettingError(name, pose, "five finite numbers (x, y, z, yaw, pitch)")
    return array


def poses_by_number(poses: object, robots: int) -> dict[int, np.ndarray]:
    """Return number → pose (5,), of poses in one of the forms that `Explorer.goal` takes.

    Raises:
        SettingError: They have none of these forms.
    """
    if isinstance(poses, Mapping):
        for number in poses:
            if not is_whole(number, 0, robots - 1):
                raise SettingError("poses", list(poses), f"numbers of robots from 0 to {robots - 1}")
        return {int(number): checked_pose(f"poses[{number}]", pose) for number, pose in poses.items()}
    try:
        rows = np.array(poses, np.float64)
    except (TypeError, ValueError):
        rows = np.zeros(0)
    rows = rows[None] if rows.shape == (5,) else rows
    if rows.shape != (robots, 5):
        raise SettingError("poses", poses, f"({robots}, 5) numbers, or a mapping from robots to five")
    return {number: checked_pose(f"poses[{number}]", row) for number, row in enumerate(rows)}
