"""Resident memory of one process, million by million of robot-steps: it settles in the first, and stays.

Every million is shared evenly by all pairs of a scenario and a channel of the soak, those that step quickest.
So the first million of a process compiles all that the later ones run, each ends with the same pair as the
one before, and what it holds then can be compared with what the first left. What is free, but kept by the
allocator for later, is given back before: it comes and goes by a hundred MiB, whatever is held.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.reliability.process_memory import resident_mib
from benchmarks.reliability.soak import ROUND
from benchmarks.reliability.step_checks import CheckedSteps
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.scenarios import SCENARIOS

ROBOT_STEPS = 10_000_000
"""Asked for in all."""
MOST_GROWTH = 0.01
"""After the first million, as a share of what the process held then."""
_MISSIONS, _CYCLES = 64, 40
"""At once, and steps of each: missions end and begin anew in every pair."""
CASE_STEPS = 1_000_000
"""Robot-steps of a case."""


def play_number(number: int) -> dict[str, Any]:
    """Play all pairs, a million robot-steps together.

    Raises:
        BrokenPromiseError: Something is not as environments promise.
        RecordError: A number of the state is in no mission of the scenario.
    """
    begun_s, begun_cpu_s, steps, most_mib = time.perf_counter(), time.process_time(), 0, 0.0
    for place in range(len(ROUND)):
        steps += _play(place, number, CASE_STEPS / len(ROUND))
        most_mib = max(most_mib, resident_mib())
    _give_back()
    return {
        "robot_steps": steps,
        "seconds": round(time.perf_counter() - begun_s, 2),
        "cpu_s": round(time.process_time() - begun_cpu_s, 2),
        "most_mib": most_mib,
        "resident_mib": resident_mib(),
        "process": os.getpid(),
    }


def _play(place: int, number: int, least: float) -> int:
    """Play one pair for at least `least` robot-steps; returns how many were played."""
    channel, name = ROUND[place]
    env = EntropyExploreVectorEnv(SCENARIOS[name], _MISSIONS, channel=channel, ending={"max_cycles": _CYCLES})
    env.action_space.seed(number)
    env.reset(seed=(number * len(ROUND) + place) * _MISSIONS)
    checked, steps, team = CheckedSteps(env), 0, env.num_envs * SCENARIOS[name].robots
    while steps < least:
        checked.note(env.step(env.action_space.sample()))
        steps += team
    checked.check(maps=True)
    env.close()
    return steps


def _give_back() -> None:
    """Let the allocator give back to the system what is free, where it can."""
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


def growth(held: Sequence[float]) -> tuple[float, float]:
    """How much more than after its first million a process holds later, as shares of what it held then.

    Args:
        held: MiB after each million, two or more.

    Returns:
        On average over the later ones; and by how much the straight line that fits these best rises.
    """
    first, later = held[0], np.asarray(held[1:])
    slope = np.polyfit(np.arange(len(later)), later, 1)[0] if len(later) > 1 else 0.0
    return float(later.mean() / first - 1.0), float(slope * (len(later) - 1) / first)
