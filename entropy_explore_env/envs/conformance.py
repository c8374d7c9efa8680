"""Conformance: does a scenario keep the contract of the environments? Whole episodes, compared exactly.

    check_conformance("room", robots=3)        # raises a ConformanceError that says what differed

or `python -m entropy_explore_env.envs.conformance room --robots 3`, which exits with 0 if all
checks hold, 1 if one does not, and 2 on bad input. Exactly means: the same types, keys in the same
order, and the same bits in every array and number.
"""

from __future__ import annotations

import argparse
import copy
import math
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from entropy_explore_env.config import Scenario, with_settings
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.single_env import SingleRobotEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.errors import ActionError, CallOrderError, EntropyExploreError, SettingError
from entropy_explore_env.missions.missions import Missions
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.missions.state import MissionEnd
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.worlds.load import with_world

EPISODES = 2
"""How many episodes in a row are compared: that after a reset with a seed, and the one that follows."""
BATCH = 8
_CHILD = "from entropy_explore_env.envs.conformance import answer_parent; answer_parent()"

Story = dict[str, Any]
"""Moment ("episode 1, step 17") → copies of all that the environment returned then."""


class ConformanceError(AssertionError):
    """The contract is broken; the message says what differed, where, and at which step."""


@dataclass(frozen=True)
class Task:
    """What is checked, and the actions that are taken.

    Attributes:
        scenario: With the grid of its world's file, if it has one.
        seed: Of mission 0; mission e takes seed + e.
    """

    scenario: Scenario
    seed: int

    def actions(self, mission: int, episode: int, step: int, other: int = 0) -> np.ndarray:
        """A team's actions: (A, N) float32 or (A,) int64; `other` gives different ones for a moment."""
        rng = np.random.default_rng([self.seed + mission, episode, step, other])
        rules, robots = rules_of(self.scenario), self.scenario.robots
        if self.scenario.action.kind == "discrete":
            return rng.integers(0, len(rules.moves) * len(rules.gazes), robots)
        return rng.uniform(-1.0, 1.0, (robots, 3 if self.scenario.planar else 5)).astype(np.float32)


def require_same(where: str, first: object, second: object) -> None:
    """Raise a ConformanceError unless two results are the same, bit by bit."""
    if type(first) is not type(second):
        raise ConformanceError(f"{where}: {type(first).__name__}, then {type(second).__name__}")
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        if list(first) != list(second):
            raise ConformanceError(f"{where}: keys {list(first)}, then {list(second)}")
        for key in first:
            require_same(f"{where}[{key!r}]" if isinstance(first, dict) else where, first[key], second[key])
    elif isinstance(first, list | tuple) and isinstance(second, list | tuple):
        require_same(where, dict(enumerate(first)), dict(enumerate(second)))
    elif isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        _require_same_array(where, first, second)
    elif _bits(first) != _bits(second):
        raise ConformanceError(f"{where}: {first!r}, then {second!r}")


def _bits(value: object) -> object:
    """Something to compare a number by: a float's hexadecimal digits, so that NaN is NaN and -0 is not 0."""
    return float(value).hex() if isinstance(value, float | np.floating) else value


def _require_same_array(where: str, first: np.ndarray, second: np.ndarray) -> None:
    """The same dtype, shape and bytes."""
    if (first.dtype, first.shape) != (second.dtype, second.shape):
        raise ConformanceError(f"{where}: {first.dtype} {first.shape}, then {second.dtype} {second.shape}")
    if first.dtype == object:
        require_same(where, first.tolist(), second.tolist())
    elif first.tobytes() != second.tobytes():
        byte = np.frombuffer(first.tobytes(), np.uint8) != np.frombuffer(second.tobytes(), np.uint8)
        place = int(np.argmax(byte)) // first.dtype.itemsize
        index = tuple(int(i) for i in np.unravel_index(place, first.shape))
        raise ConformanceError(f"{where} at {index}: {first[index]!r}, then {second[index]!r}")


def moment_of(env: EntropyExploreEnv, result: tuple[Any, ...]) -> dict[str, Any]:
    """A copy of what reset or step returned, by name, and of the state."""
    names = ("observations", "rewards", "terminations", "truncations", "infos")
    named = zip(names if len(result) == 5 else ("observations", "infos"), result, strict=True)
    return copy.deepcopy({**dict(named), "state": env.state()})


def finish(
    env: EntropyExploreEnv, task: Task, mission: int = 0, episode: int = 0, step: int = 0, other: int = 0
) -> Story:
    """Play an episode from here to its end; `step` have been taken."""
    story: Story = {}
    while env.agents:
        step += 1
        actions = task.actions(mission, episode, step, other)
        result = env.step(dict(zip(env.agents, actions, strict=True)))
        story[f"episode {episode}, step {step}"] = moment_of(env, result)
    return story


def play(env: EntropyExploreEnv, task: Task, mission: int = 0) -> Story:
    """Play whole episodes after a reset with the mission's seed."""
    story: Story = {}
    for episode in range(EPISODES):
        start = env.reset(seed=None if episode else task.seed + mission)
        story[f"episode {episode}, step 0"] = moment_of(env, start)
        story |= finish(env, task, mission, episode)
    return story


def check_spaces(task: Task) -> None:
    """Observations lie in their spaces, spaces stay the same objects, rewards are finite."""
    env = EntropyExploreEnv(task.scenario)
    agents = list(task.scenario.agents)
    spaces = {agent: (env.observation_space(agent), env.action_space(agent)) for agent in agents}
    state_space = env.state_space
    for where, moment in play(env, task).items():
        for name in ("observations", "rewards", "terminations", "truncations", "infos"):
            if name in moment and list(moment[name]) != agents:
                raise ConformanceError(f"{where}: {name} for {list(moment[name])}, not {agents}")
        for agent in agents:
            if not spaces[agent][0].contains(moment["observations"][agent]):
                raise ConformanceError(f"{where}: the observation of {agent} is outside its space")
            reward = moment.get("rewards", {agent: 0.0})[agent]
            if not isinstance(reward, float) or not math.isfinite(reward):
                raise ConformanceError(f"{where}: the reward of {agent} is {reward!r}")
        if not state_space.contains(moment["state"]):
            raise ConformanceError(f"{where}: state() is outside state_space")
    for agent in agents:
        if (env.observation_space(agent), env.action_space(agent)) != spaces[agent] or any(
            now is not then
            for now, then in zip(
                (env.observation_space(agent), env.action_space(agent)), spaces[agent], strict=True
            )
        ):
            raise ConformanceError(f"the spaces of {agent} are other objects than before the episodes")
    if env.state_space is not state_space:
        raise ConformanceError("state_space is another object than before the episodes")
