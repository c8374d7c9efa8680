"""Named scenarios for a long time in one process: the contract holds at every step, memory does not grow."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.reliability.settings_fuzz import BrokenPromiseError
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenarios import SCENARIOS

ROBOT_STEPS = 50_000
"""Of a case."""
_CHANNELS: tuple[dict[str, Any], ...] = (
    {},
    {"delay_s": 2.0},
    {"loss_probability": 0.5},
    {"range_m": 3.0},
    {"phase_s": 10.0, "repeats": 2},
    {"burst": 0, "announcements": False},
)


def play_number(number: int) -> dict[str, Any]:
    """Play one scenario over one channel; the rest of the numbers begins again from the first.

    Raises:
        BrokenPromiseError: An observation is outside its space, or a reward not finite.
    """
    name = list(SCENARIOS)[number % len(SCENARIOS)]
    env = EntropyExploreEnv(name, channel=_CHANNELS[number // len(SCENARIOS) % len(_CHANNELS)])
    env.reset(seed=number)
    bounds = env.missions.layout.flat_space(env.scenario.robots)
    for agent in env.possible_agents:
        env.action_space(agent).seed(number)
    played, episodes = 0, 1
    while played < ROBOT_STEPS:
        if not env.agents:
            env.reset()
            episodes += 1
        rewards = env.step({agent: env.action_space(agent).sample() for agent in env.agents})[1]
        played += len(rewards)
        if not bounds.contains(env.state()):
            raise BrokenPromiseError(f"{name}: observations are outside their space")
        if not all(map(math.isfinite, rewards.values())):
            raise BrokenPromiseError(f"{name}: rewards are {rewards}")
    if not np.isfinite(env.missions.state.robots["entropy_bits"]).all():
        raise BrokenPromiseError(f"{name}: an entropy is not finite")
    return {"scenario": name, "episodes": episodes, "resident_mib": resident_mib()}


def resident_mib() -> float:
    """Memory of this process, in MiB; nan where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    except OSError:
        return math.nan
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
