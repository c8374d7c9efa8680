"""Named scenarios over every channel for a long time: the contract holds, and memory does not grow.

At each step observations are in their space, rewards are finite, time does not run backwards, ends are told,
and the bits gained are those by which entropy fell; at set intervals, each number of the state is in its
range.
"""

from __future__ import annotations

import ctypes
import gc
import itertools
import math
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.proofs.cases import BrokenPromiseError, Found, check_step
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.missions.state_ranges import check_ranges
from entropy_explore_env.settings.scenarios import SCENARIOS

ROBOT_STEPS = 20_000
"""Robot-steps of a case."""
CHANNELS: tuple[dict[str, Any], ...] = (
    {},
    {"delay_s": 2.0},
    {"loss_probability": 0.5},
    {"loss_probability": 0.5, "order": "need"},
    {"range_m": 3.0},
    {"phase_s": 10.0, "repeats": 2},
    {"burst": 0, "announcements": False},
    {"reach": "line_of_sight"},
    {"reach": "signal"},
    {"content": "summaries"},
    {"content": "summaries", "summary_every_s": 1.0, "delay_s": 2.0},
)
PAIRS = tuple(itertools.product(CHANNELS, SCENARIOS))
QUICK_PAIRS = tuple(itertools.product(CHANNELS, ("box-7x11x5", "room", "room-furnished")))
"""The pairs among which the proof of memory shares its robot-steps."""
MEMORY_STEPS, MEMORY_ROUNDS = 1_000_000, 3
"""Robot-steps of a round of all quick pairs, and rounds of a case."""
MOST_GROWTH = 0.01
"""Most resident memory beyond that after the first round, as a share of it."""
_RANGES_EVERY = 20
"""Steps between two looks at every number of the state."""
_CYCLES = 40
"""Steps of a mission, so that missions begin anew."""
_MOST_VOXELS, _MOST_MISSIONS = 4_000_000, 64
_BITS = 1e-6
"""Rounding of sums of bits, as a share of a map's."""


def play(number: int) -> Found:
    """Play one scenario over one channel for ROBOT_STEPS.

    Raises:
        BrokenPromiseError: A step breaks the contract.
        RecordError: A number of the state is outside its range.
    """
    channel, name = PAIRS[number % len(PAIRS)]
    steps, missions = walk(name, channel, ROBOT_STEPS, number)
    return Found({"robot-steps": steps, "missions": missions}, name)


def play_memory(number: int) -> Found:
    """Play all quick pairs in rounds, and compare resident memory after each round with the first.

    The first round compiles all that the later ones run.

    Raises:
        BrokenPromiseError: Memory grew by more than MOST_GROWTH, or a step breaks the contract.
        RecordError: A number of the state is outside its range.
    """
    steps, held = 0, []
    for each in range(MEMORY_ROUNDS):
        for place, (channel, name) in enumerate(QUICK_PAIRS):
            seed = (number * MEMORY_ROUNDS + each) * len(QUICK_PAIRS) + place
            steps += walk(name, channel, MEMORY_STEPS // len(QUICK_PAIRS), seed)[0]
        _give_back()
        held.append(resident_mib())
    grown = max(held[1:]) / held[0] - 1.0
    if grown > MOST_GROWTH:
        raise BrokenPromiseError(f"resident memory grew by {grown:.1%}: {held} MiB")
    return Found({"robot-steps": steps, "MiB at most": max(held), "% grown at most": 100.0 * grown})


def walk(name: str, channel: dict[str, Any], robot_steps: int, seed: int) -> tuple[int, int]:
    """Play a batch of missions by drawn actions; returns robot-steps and the number of missions begun."""
    scenario = SCENARIOS[name]
    count = min(max(_MOST_VOXELS // (scenario.grid.voxels * scenario.robots), 1), _MOST_MISSIONS)
    env = EntropyExploreVectorEnv(scenario, count, channel=channel, ending={"max_cycles": _CYCLES})
    env.action_space.seed(seed % 2**31)
    env.reset(seed=seed * _MOST_MISSIONS)
    team, before = count * scenario.robots, _moment(env)
    steps = math.ceil(robot_steps / team)
    for step in range(steps):
        stepped, now = env.step(env.action_space.sample()), _moment(env)
        check(env, stepped, before, now)
        before = now
        if step % _RANGES_EVERY == 0 or step == steps - 1:
            check_ranges(env.scenario, env.missions.state._asdict())
    missions = int(sum(env.missions.episodes)) + count
    env.close()
    return steps * team, missions


def _moment(env: EntropyExploreVectorEnv) -> tuple[np.ndarray, np.ndarray]:
    """Return copies of the records of missions (E,) and robots (E, A)."""
    state = env.missions.state
    return state.missions.copy(), state.robots.copy()


def check(
    env: EntropyExploreVectorEnv,
    stepped: tuple[Any, ...],
    before: tuple[np.ndarray, np.ndarray],
    now: tuple[np.ndarray, np.ndarray],
) -> None:
    """Raise a BrokenPromiseError unless a step kept the contract.

    It is told by what the step returned, and by records of missions (E,) and robots (E, A) before and after.
    """
    name = env.scenario.name
    _, rewards, terminated, truncated, infos = stepped
    check_step(env.missions, (rewards, infos["reward_robots"]))
    (missions_before, robots_before), (missions, robots) = before, now
    over, begun = missions["end"] != 0, missions_before["end"] != 0
    if not np.array_equal(terminated | truncated, over) or (terminated & truncated).any():
        raise BrokenPromiseError(f"{name}: missions end, and the step does not say so")
    time_s = missions["time_s"]
    if (time_s < missions_before["time_s"])[~begun].any() or time_s[begun].any():
        raise BrokenPromiseError(f"{name}: time ran backwards, or a mission did not begin at 0 s")
    lost_bits = robots_before["entropy_bits"] - robots["entropy_bits"]
    gained_bits = robots["own_bits"] + robots["received_bits"]
    scale = _BITS * np.maximum(np.abs(robots_before["entropy_bits"]), 1.0)
    if (np.abs(lost_bits - gained_bits) > scale)[~begun].any():
        raise BrokenPromiseError(f"{name}: bits gained are not those by which entropy fell")


def resident_mib() -> float:
    """Return the resident memory of this process in MiB; nan where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    except OSError:
        return math.nan
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def _give_back() -> None:
    """Let the allocator return free memory to the system, where it can."""
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)
