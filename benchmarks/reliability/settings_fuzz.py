"""Drawn scenarios, played by drawn actions: none hangs, crashes, or leaves what environments promise."""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.reliability.drawn_scenarios import Drawn, draw_scenario
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import EntropyExploreError, RecordError
from entropy_explore_env.missions.state_ranges import check_ranges
from entropy_explore_env.settings_json import settings_json

STEPS = 50
WATCHDOG_S = 20.0
"""The steps of a scenario take less processor time, compiling kernels aside."""
_MOST_DRAWS = 10_000


class BrokenPromiseError(AssertionError):
    """An environment did what it never may."""


@dataclass(frozen=True)
class Task:
    """One scenario to be drawn and played.

    Attributes:
        number: What everything is drawn from.
        steps: How many steps are played, in as many episodes as it takes.
        few_kernels: See `draw_scenario`.
    """

    number: int
    steps: int = STEPS
    few_kernels: bool = False


@dataclass(frozen=True)
class Played:
    """What came of a scenario.

    Attributes:
        number: Of the task.
        refused: Why scenarios that were drawn before were not allowed: names of fields.
        seconds: Of the processor, for all steps but the first, which may compile kernels.
        episodes: How many were begun.
        settings: Of the scenario, as JSON.
    """

    number: int
    refused: tuple[str, ...]
    seconds: float
    episodes: int
    settings: str


def play(task: Task) -> Played:
    """Draw scenarios until one is allowed, and play it.

    Raises:
        BrokenPromiseError: An observation is outside its space, a figure not finite, time ran backwards, or
            the steps took longer than WATCHDOG_S.
        Exception: Whatever an environment raises that is no EntropyExploreError.
    """
    refused: list[str] = []
    for draw in range(_MOST_DRAWS):
        rng = np.random.default_rng([task.number, draw])
        try:
            drawn = draw_scenario(rng, task.few_kernels)
            env = _environment(drawn)
            env.reset(seed=task.number)
        except EntropyExploreError as error:
            refused.append(str(getattr(error, "field", type(error).__name__)))
            continue
        seconds, episodes = _play(env, rng, task)
        settings = settings_json(drawn.scenario)
        if seconds > WATCHDOG_S:
            raise BrokenPromiseError(f"{task.steps} steps took {seconds:.1f} s: {settings}")
        return Played(task.number, tuple(refused), seconds, episodes, settings)
    raise BrokenPromiseError(f"none of {_MOST_DRAWS} drawn scenarios was allowed")


def _environment(drawn: Drawn) -> EntropyExploreEnv:
    if not drawn.given:
        return EntropyExploreEnv(drawn.scenario)
    return EntropyExploreEnv(drawn.scenario, world=drawn.given)


def _play(env: EntropyExploreEnv, rng: np.random.Generator, task: Task) -> tuple[float, int]:
    """Processor seconds of all steps but the first, and how many episodes they were in."""
    agents, seconds, episodes, earlier_s = env.possible_agents, 0.0, 1, 0.0
    for agent in agents:
        env.action_space(agent).seed(int(rng.integers(2**31)))
    for step in range(task.steps):
        if not env.agents:
            _go_on(env, task.number)
            episodes, earlier_s = episodes + 1, 0.0
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        begun_s = time.process_time()
        observations, rewards = env.step(actions)[:2]
        if step > 0:
            seconds += time.process_time() - begun_s
        earlier_s = _check(env, observations, rewards, earlier_s)
    return seconds, episodes


def _go_on(env: EntropyExploreEnv, seed: int) -> None:
    """Start the next episode, or the first again where the next world has too little room for the team."""
    try:
        env.reset()
    except EntropyExploreError:
        env.reset(seed)


def _outside(env: EntropyExploreEnv, agent: str) -> str:
    """The numbers of an observation that its space does not have, with their places in the flat one."""
    layout, robot = env.missions.layout, env.possible_agents.index(agent)
    seen = env.missions.observations[0, robot]
    within = (seen >= layout.low.astype(np.float32)) & (seen <= layout.high.astype(np.float32))
    return ", ".join(
        f"{seen[place]!r} at {place} of {list(layout.parts)}" for place in np.flatnonzero(~within)
    )


def _check(env: EntropyExploreEnv, observations: dict, rewards: dict, earlier_s: float) -> float:
    """Check what a step gave; returns the mission's time."""
    for agent, observed in observations.items():
        if not env.observation_space(agent).contains(observed):
            raise BrokenPromiseError(
                f"{agent} observed {_outside(env, agent)} outside its space: {env.scenario}"
            )
    figures = {f"the reward of {agent}": reward for agent, reward in rewards.items()}
    figures["the time"] = time_s = float(env.missions.state.missions[0]["time_s"])
    for name, value in figures.items():
        if not math.isfinite(value):
            raise BrokenPromiseError(f"{name} is {value}: {env.scenario}")
    try:
        check_ranges(env.scenario, env.missions.state._asdict())
    except RecordError as error:
        raise BrokenPromiseError(f"{error}: {env.scenario}") from None
    if time_s < earlier_s:
        raise BrokenPromiseError(f"time ran from {earlier_s} back to {time_s} s: {env.scenario}")
    return time_s


def play_number(number: int) -> dict[str, Any]:
    """The case of a number, as what is kept of it.

    One in a hundred has any parts of an observation: others would compile for hours.
    """
    return dataclasses.asdict(play(Task(number, few_kernels=number % 100 > 0)))
