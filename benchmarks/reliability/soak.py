"""Named scenarios for a long time in one process: the contract holds at every step, memory does not grow.

The smallest scenario steps fifty times as fast as the largest. So every scenario is played over every channel
for a stated number of robot-steps, and what is then left is shared, by time, among the scenarios that step
quickest; the page says what each of them came to.
"""

from __future__ import annotations

import itertools
import math
import os
import time
from typing import Any

from benchmarks.reliability.process_memory import resident_mib
from benchmarks.reliability.step_checks import CheckedSteps
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.scenarios import SCENARIOS

ROBOT_STEPS = 100_000_000
"""Asked for in all."""
FLOOR = 20_000
"""Robot-steps of every scenario over every channel."""
CASE_S = 10.0
"""Of the processor, for the steps of a case beyond the floor."""
QUICK = ("box-7x11x5", "room", "room-furnished")
"""The scenarios that are played beyond it."""
_CYCLES = 400
"""Steps of a mission, so that missions begin anew."""
_SETTLED = 0.2
"""Share of a case after which its memory is taken for settled."""
MAPS_EVERY = 200
"""Steps between two looks at every voxel; all else is looked at in each."""
_MOST_VOXELS, _MOST_MISSIONS = 4_000_000, 256
CHANNELS: tuple[dict[str, Any], ...] = (
    {},
    {"delay_s": 2.0},
    {"loss_probability": 0.5},
    {"range_m": 3.0},
    {"phase_s": 10.0, "repeats": 2},
    {"burst": 0, "announcements": False},
    {"reach": "line_of_sight"},
    {"reach": "signal"},
    {"content": "summaries"},
    {"content": "summaries", "summary_every_s": 1.0, "delay_s": 2.0},
)
FLOOR_CASES = tuple(itertools.product(CHANNELS, SCENARIOS))
ROUND = tuple(itertools.product(CHANNELS, QUICK))
"""Cases beyond the floor, again and again."""


def play_number(number: int) -> dict[str, Any]:
    """Play one scenario over one channel.

    Raises:
        BrokenPromiseError: Something is not as environments promise.
        RecordError: A number of the state is in no mission of the scenario.
    """
    beyond = number >= len(FLOOR_CASES)
    cases = ROUND if beyond else FLOOR_CASES
    channel, name = cases[number % len(cases)]
    scenario = SCENARIOS[name]
    env = EntropyExploreVectorEnv(
        scenario, missions_of(scenario), channel=channel, ending={"max_cycles": _CYCLES}
    )
    env.action_space.seed(number)
    env.reset(seed=number * _MOST_MISSIONS)
    team = env.num_envs * scenario.robots
    env.step(env.action_space.sample())  # compiles
    checked, steps, settled_mib = CheckedSteps(env), 1, math.nan
    begun_s, begun_cpu_s = time.perf_counter(), time.process_time()
    done = 0.0
    while done < 1.0:
        if math.isnan(settled_mib) and done > _SETTLED:
            settled_mib = resident_mib()
        checked.note(env.step(env.action_space.sample()))
        steps += 1
        if steps % MAPS_EVERY == 0:
            checked.check(maps=True)
        done = (time.process_time() - begun_cpu_s) / CASE_S if beyond else steps * team / FLOOR
    checked.check(maps=True)
    row = {
        "scenario": name,
        "channel": CHANNELS.index(channel),
        "robot_steps": steps * team,
        "missions": int(sum(env.missions.episodes)) + env.num_envs,
        "seconds": round(time.perf_counter() - begun_s, 2),
        "cpu_s": round(time.process_time() - begun_cpu_s, 2),
        "settled_mib": settled_mib,
        "resident_mib": resident_mib(),
        "process": os.getpid(),
    }
    env.close()
    return row


def round_of(number: int) -> int:
    """How many rounds of all pairs were begun before a case beyond the floor; -1 of one of the floor."""
    return (number - len(FLOOR_CASES)) // len(ROUND) if number >= len(FLOOR_CASES) else -1


def robot_steps(row: dict[str, Any]) -> int:
    """What a case counts for; one that failed for nothing."""
    return row.get("robot_steps", 0)


def missions_of(scenario: Scenario) -> int:
    """How many missions of a scenario are played at once."""
    return min(max(_MOST_VOXELS // (scenario.grid.voxels * scenario.robots), 1), _MOST_MISSIONS)
