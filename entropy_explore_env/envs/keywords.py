"""The settings that environments take as keywords, for type checkers: `parallel_env("room", robts=3)` is one.

At run time the settings check themselves (`scenario.with_settings`, `worlds.given`).
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

from entropy_explore_env.envs.rewards import RewardFunction
from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.channel import Channel
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.faults import Faults
from entropy_explore_env.settings.fiducials import Fiducials
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.reward import Reward
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.worlds.world import World


class ScenarioSettings(TypedDict, total=False):
    """Fields of a Scenario, and what is short for fields of its ending; parts also as mappings of fields."""

    name: str
    grid: Grid | Mapping[str, Any]
    world: str | os.PathLike[str] | World | Sequence[World] | Mapping[str, Any]
    split: Literal["train", "validation", "test"]
    robots: int
    start_radius_m: float
    decision_period_s: float | None
    track_truth: bool
    robot: Robot | Mapping[str, Any]
    sensor: RangeSensor | Mapping[str, Any]
    extra_kinds: tuple[RobotKind, ...]
    channel: Channel | Mapping[str, Any]
    faults: Faults | Mapping[str, Any]
    fiducials: Fiducials | Mapping[str, Any]
    ending: Ending | Mapping[str, Any]
    reward: Reward | Mapping[str, Any]
    action: Action | Mapping[str, Any]
    observation: Observation | Mapping[str, Any]
    max_cycles: int | None
    time_limit_s: float


class EnvironmentSettings(ScenarioSettings, total=False):
    """All keywords of environments of one mission: see `EntropyExploreEnv`."""

    reward_function: RewardFunction | None
    every_reset: Mapping[str, Any] | None
