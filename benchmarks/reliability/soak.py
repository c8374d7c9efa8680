"""Named scenarios for a long time in one process: the contract holds at every step, memory does not grow.

The smallest scenario steps a thousand times as fast as the largest, so a case has a share of the processor,
not of the steps: all scenarios get the same time, and the page says what each came to.
"""

from __future__ import annotations

import itertools
import math
import os
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.reliability.settings_fuzz import BrokenPromiseError
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.missions.state_ranges import check_ranges
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.scenarios import SCENARIOS

ROBOT_STEPS = 100_000_000
"""Asked for in all."""
CASE_S = 6.0
"""Of the processor, for the steps of a case."""
_CYCLES = 400
"""Steps of a mission, so that missions begin anew."""
_SETTLED = 0.2
"""Share of a case after which its memory is taken for settled."""
_MAPS_EVERY = 200
"""Steps between two looks at every voxel; all else is looked at in each."""
_MOST_VOXELS, _MOST_MISSIONS = 2_000_000, 128
_BITS = 1e-6
"""Rounding of sums of bits, as a share of a map's."""
CHANNELS: tuple[dict[str, Any], ...] = (
    {},
    {"delay_s": 2.0},
    {"loss_probability": 0.5},
    {"range_m": 3.0},
    {"phase_s": 10.0, "repeats": 2},
    {"burst": 0, "announcements": False},
)
_CASES = tuple(itertools.product(CHANNELS, SCENARIOS))
ROUND = len(_CASES)
"""Cases after which the scenarios and channels begin again, with other seeds."""


class Moment(NamedTuple):
    """What the next step is compared with."""

    time_s: np.ndarray
    """(E,) float64."""
    entropy_bits: np.ndarray
    """(E, A) float64."""
    over: np.ndarray
    """(E,) bool: the next step begins another mission."""


def play_number(number: int) -> dict[str, Any]:
    """Play one scenario over one channel.

    Raises:
        BrokenPromiseError: Something is not as environments promise.
    """
    channel, name = _CASES[number % ROUND]
    scenario = SCENARIOS[name]
    env = EntropyExploreVectorEnv(
        scenario, missions_of(scenario), channel=channel, ending={"max_cycles": _CYCLES}
    )
    env.action_space.seed(number)
    env.reset(seed=number * _MOST_MISSIONS)
    team = env.num_envs * scenario.robots
    env.step(env.action_space.sample())  # compiles
    moment, steps, settled_mib = _moment(env), 1, math.nan
    begun_s, begun_cpu_s = time.perf_counter(), time.process_time()
    while (spent_s := time.process_time() - begun_cpu_s) < CASE_S:
        if math.isnan(settled_mib) and spent_s > _SETTLED * CASE_S:
            settled_mib = resident_mib()
        stepped = env.step(env.action_space.sample())
        steps += 1
        moment = check_step(env, stepped, moment, maps=steps % _MAPS_EVERY == 0)
    row = {
        "scenario": name,
        "robot_steps": steps * team,
        "missions": int(sum(env.missions.episodes)) + env.num_envs,
        "seconds": round(time.perf_counter() - begun_s, 2),
        "settled_mib": settled_mib,
        "resident_mib": resident_mib(),
        "process": os.getpid(),
    }
    env.close()
    return row


def robot_steps(row: dict[str, Any]) -> int:
    """What a case counts for; one that failed for nothing."""
    return row.get("robot_steps", 0)


def missions_of(scenario: Scenario) -> int:
    """How many missions of a scenario are played at once."""
    return min(max(_MOST_VOXELS // (scenario.grid.voxels * scenario.robots), 1), _MOST_MISSIONS)


def _moment(env: EntropyExploreVectorEnv) -> Moment:
    state = env.missions.state
    over = state.missions["end"] != 0
    return Moment(state.missions["time_s"].copy(), state.robots["entropy_bits"].copy(), over)


def check_step(env: EntropyExploreVectorEnv, stepped: tuple[Any, ...], before: Moment, maps: bool) -> Moment:
    """Check all that a step gave; returns what the next one is compared with.

    Args:
        env: After the step.
        stepped: What `step` returned.
        before: Of the step before.
        maps: Whether every voxel is looked at, too.

    Raises:
        BrokenPromiseError: Something is not as environments promise.
    """
    missions, rewards, ended = env.missions, stepped[1], stepped[2] | stepped[3]
    name, robots = env.scenario.name, missions.state.robots
    layout, infos, moment = missions.layout, stepped[4], _moment(env)
    outside = numbers_outside(missions.observations, layout.low, layout.high)
    if outside:
        raise BrokenPromiseError(f"{name}: {outside} numbers of observations are outside their space")
    if not np.isfinite(rewards).all() or not np.isfinite(infos["reward_robots"]).all():
        raise BrokenPromiseError(f"{name}: rewards are {rewards}")
    if not np.array_equal(ended, moment.over) or (stepped[2] & stepped[3]).any():
        raise BrokenPromiseError(f"{name}: missions end, and the step does not say so")
    same = ~before.over
    if (moment.time_s[same] < before.time_s[same]).any() or moment.time_s[before.over].any():
        raise BrokenPromiseError(f"{name}: time went from {before.time_s} to {moment.time_s} s")
    gained = before.entropy_bits - moment.entropy_bits
    told = robots["own_bits"] + robots["received_bits"]
    scale = _BITS * np.maximum(np.abs(before.entropy_bits), 1.0)
    if (np.abs(gained - told) > scale)[same].any():
        raise BrokenPromiseError(f"{name}: bits gained are not those by which entropy fell")
    check_ranges(env.scenario, missions.state._asdict(), maps)
    return moment


@lean_kernel
def numbers_outside(observations, low, high):
    """How many numbers of observations are outside their space, NaN among them.

    Args:
        observations: (E, A, F) float32.
        low: (F,) float64, the least.
        high: (F,) float64, the largest.
    """
    outside = 0
    for place in range(observations.shape[2]):
        least, most = np.float32(low[place]), np.float32(high[place])
        for mission in range(observations.shape[0]):
            for robot in range(observations.shape[1]):
                seen = observations[mission, robot, place]
                outside += int(not (least <= seen <= most))
    return outside


def resident_mib() -> float:
    """Memory of this process, in MiB; nan where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    except OSError:
        return math.nan
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
