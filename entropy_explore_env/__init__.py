"""Teams of robots that map an unknown 3-D world, as PettingZoo and Gymnasium environments.

    import entropy_explore_env
    env = entropy_explore_env.parallel_env("room", robots=3)

Importing registers, for every scenario (room → Room-v1), `gymnasium.make`, `gymnasium.make_vec` and
`pettingzoo.make("parallel" | "aec", ...)` under `entropy_explore_env/`.
"""

from __future__ import annotations

from entropy_explore_env import starting  # noqa: F401 - first, since all that follows takes a while

# isort: split
import gymnasium
import pettingzoo

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv, env, parallel_env
from entropy_explore_env.envs.rewards import StepFigures
from entropy_explore_env.envs.single_env import SingleRobotEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.errors import (
    ActionError,
    CallOrderError,
    EntropyExploreError,
    MissingExtraError,
    RecordError,
    SettingError,
    WorldError,
    WorldWarning,
)
from entropy_explore_env.explorer.explorer import Explorer
from entropy_explore_env.explorer.goals import Goal, NoGoal
from entropy_explore_env.interop.map_files import load_map, save_map
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.channel import Delivery
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.channel import Channel, Signal
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.faults import Faults, Outage, RadioFault, SensorFault
from entropy_explore_env.settings.fiducials import Fiducials
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.reward import Reward
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS, find_scenario
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.version import VERSION
from entropy_explore_env.worlds.load import load_octomap, load_world, make_world, save_world
from entropy_explore_env.worlds.world import World

__version__ = VERSION

__all__ = [
    "SCENARIOS",
    "Action",
    "ActionError",
    "CallOrderError",
    "Channel",
    "Delivery",
    "Ending",
    "EntropyExploreEnv",
    "EntropyExploreError",
    "EntropyExploreVectorEnv",
    "Explorer",
    "Faults",
    "Fiducials",
    "Goal",
    "Grid",
    "Localization",
    "Map",
    "MissingExtraError",
    "MissionEnd",
    "Missions",
    "MoveEnd",
    "NoGoal",
    "Observation",
    "Outage",
    "RadioFault",
    "RangeSensor",
    "RecordError",
    "Reward",
    "Robot",
    "RobotKind",
    "RobotView",
    "Scenario",
    "SensorFault",
    "SettingError",
    "Signal",
    "SingleRobotEnv",
    "StepFigures",
    "World",
    "WorldError",
    "WorldWarning",
    "env",
    "find_scenario",
    "load_map",
    "load_octomap",
    "load_world",
    "make_world",
    "parallel_env",
    "save_map",
    "save_world",
    "with_settings",
]


def environment_id(scenario: str) -> str:
    """Return the id of a named scenario: `room-furnished` → `entropy_explore_env/RoomFurnished-v1`.

    Raises:
        SettingError: No scenario has this name.
    """
    words = find_scenario(scenario).name.split("-")
    return "entropy_explore_env/" + "".join(word[:1].upper() + word[1:] for word in words) + "-v1"


_MAPPED_IN_TIME = 0.8
"""A mission that maps all that it should returns 1, less what its seconds cost: this is a good mission's."""


def _register() -> None:
    """Register every named scenario with Gymnasium and PettingZoo.

    A robot on its own waits for no other: under Gymnasium a step lasts until it may decide again. Every
    decision is followed by a scan, so that a mission has at most `max_episode_steps` of them; where settings
    change that, `gymnasium.make(..., max_episode_steps=-1)` leaves the end to the mission.
    """
    for scenario, task in SCENARIOS.items():
        name = environment_id(scenario)
        gymnasium.register(
            id=name,
            entry_point="entropy_explore_env.envs.single_env:SingleRobotEnv",
            vector_entry_point="entropy_explore_env.envs.vector_env:registered_vector_env",
            kwargs={"scenario": scenario, "robots": 1, "decision_period_s": None},
            max_episode_steps=task.most_decisions,
            reward_threshold=_MAPPED_IN_TIME,
        )
        pettingzoo.register("parallel", name, parallel_env, kwargs={"scenario": scenario})
        pettingzoo.register("aec", name, env, kwargs={"scenario": scenario})


_register()
