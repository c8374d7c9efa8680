"""Drawn scenarios, played by drawn actions: none hangs, crashes, or breaks what environments promise."""

from __future__ import annotations

import math
import time

from benchmarks.proofs.cases import BrokenPromiseError, Found, check_step
from benchmarks.proofs.drawn_scenarios import first_allowed
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import EntropyExploreError
from entropy_explore_env.missions.state_ranges import check_ranges
from entropy_explore_env.settings.json import settings_of

STEPS = 50
WATCHDOG_S = 20.0
"""Most processor time of a scenario's steps, without the compilation of kernels."""
_ALL_KERNELS_EVERY = 100
"""Every hundredth scenario may observe anything: if all did, compiling would take hours."""


def play(number: int) -> Found:
    """Draw scenarios until one is allowed, and play it.

    Raises:
        BrokenPromiseError: An observation is outside its space, a number is not finite, time ran backwards,
            or the steps took longer than WATCHDOG_S.
    """
    few_kernels = number % _ALL_KERNELS_EVERY > 0
    drawn, refused = first_allowed(number, few_kernels)
    env = EntropyExploreEnv(drawn.scenario, **({"world": drawn.given} if drawn.given else {}))
    env.reset(seed=number)
    seconds, episodes = _play(env, number)
    if seconds > WATCHDOG_S:
        raise BrokenPromiseError(f"{STEPS} steps took {seconds:.1f} s: {settings_of(drawn.scenario)}")
    return Found({"episodes": episodes, "scenarios refused before": refused, "s at most": seconds})


def _play(env: EntropyExploreEnv, number: int) -> tuple[float, int]:
    """Return processor seconds of all steps after the first, which compiles, and the number of episodes."""
    seconds, episodes, earlier_s = 0.0, 1, 0.0
    for robot, agent in enumerate(env.possible_agents):
        env.action_space(agent).seed(number % 2**31 + robot)
    for step in range(STEPS):
        if not env.agents:
            try:
                env.reset()
            except EntropyExploreError:  # the next world has too little room for the team
                env.reset(number)
            episodes, earlier_s = episodes + 1, 0.0
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        begun_s = time.process_time()
        observations, rewards = env.step(actions)[:2]
        if step > 0:
            seconds += time.process_time() - begun_s
        earlier_s = check(env, observations, rewards, earlier_s)
    return seconds, episodes


def check(env: EntropyExploreEnv, observations: dict, rewards: dict, earlier_s: float) -> float:
    """Check what a step returned; returns the mission's time.

    Raises:
        BrokenPromiseError: See `play`.
        RecordError: A number of the state is outside its range.
    """
    check_step(env.missions, rewards.values())
    for agent, observed in observations.items():
        if not env.observation_space(agent).contains(observed):
            raise BrokenPromiseError(f"what {agent} observed is not in its space: {env.scenario}")
    check_ranges(env.scenario, env.missions.state._asdict())
    time_s = float(env.missions.state.missions[0]["time_s"])
    if not earlier_s <= time_s < math.inf:
        raise BrokenPromiseError(f"time ran from {earlier_s} to {time_s} s: {env.scenario}")
    return time_s
