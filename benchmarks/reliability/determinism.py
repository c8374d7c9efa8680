"""The same drawn scenario in processes that differ in all that must not matter: the same bits.

Processes differ in the processor that kernels are compiled for, in threads, in how many missions there are
beside the one that is compared, and in Python's hash seed; each is a fresh one, some of them forked. A
process plays several scenarios, because its start and its kernels take most of its time.
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from typing import Any

import numpy as np
from gymnasium import spaces

from benchmarks.reliability.drawn_scenarios import Drawn, draw_scenario
from entropy_explore_env.errors import EntropyExploreError
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.state_values import state_digest

STEPS = 40
PROCESSORS = ("", "generic", "haswell")
"""As NUMBA_CPU_NAME has them; empty = this one."""
_CASES = tuple(itertools.product(PROCESSORS, (1, 2), (1, 3)))
VARIANTS = len(_CASES)
SCENARIOS_EACH = 10
"""Played by a process."""


def play_number(number: int) -> dict[str, Any]:
    """Some drawn scenarios in one variant: the digest of the state of each after some steps."""
    block, variant = divmod(number, VARIANTS)
    first = block * SCENARIOS_EACH
    processor, threads, missions = _CASES[variant]
    variables = {**os.environ, "PYTHONHASHSEED": str(number), "PYTHONPATH": os.pathsep.join(sys.path)}
    if processor:
        variables |= {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
    if processor == "haswell":
        variables["NUMBA_CPU_FEATURES"] = "+avx2,+fma,+bmi,+bmi2"
    words = [sys.executable, "-W", "ignore", "-m", __name__, str(first), str(threads), str(missions)]
    done = subprocess.run(words, env=variables, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"exit code {done.returncode}: {done.stderr.strip()[-300:]}")
    return {"first": first, "variant": variant, "digests": json.loads(done.stdout)}


def plays_of(row: dict[str, Any]) -> int:
    """What a case counts for; one that failed for nothing."""
    return len(row.get("digests", ()))


def digest_of(number: int, threads: int, missions: int) -> str:
    """The digest of the first of some missions in a drawn scenario; the others are other episodes."""
    drawn, draw = None, 0
    while drawn is None:
        drawn, draw = _allowed(number, draw), draw + 1
    team = Missions(drawn.scenario, missions, threads, drawn.given)
    team.reset_some(range(missions), [number] * missions)
    rng = np.random.default_rng(number)
    axes, space = 5, action_space(drawn.scenario)
    choices = int(space.n) if isinstance(space, spaces.Discrete) else 1
    for _ in range(STEPS):
        boxes = rng.uniform(-1.0, 1.0, (1, drawn.scenario.robots, axes)).astype(np.float32).astype(np.float64)
        numbers = rng.integers(0, choices, (1, drawn.scenario.robots))
        team.step(np.repeat(boxes, missions, axis=0), np.repeat(numbers, missions, axis=0))
    return state_digest(team, 0)


def _allowed(number: int, draw: int) -> Drawn | None:
    """A drawn scenario, if it is allowed and its first mission has room."""
    try:
        drawn = draw_scenario(np.random.default_rng([number, draw, 1]), few_kernels=True)
        Missions(drawn.scenario, given=drawn.given).reset(0, number)
    except EntropyExploreError:
        return None
    return drawn


if __name__ == "__main__":
    if int(sys.argv[3]) > 1 and hasattr(os, "fork"):  # those with company are forked
        child = os.fork()
        if child:
            sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    begin, *company = (int(word) for word in sys.argv[1:4])
    print(json.dumps([digest_of(number, *company) for number in range(begin, begin + SCENARIOS_EACH)]))
