"""The same drawn scenarios in processes that differ in everything that must not matter: the same bits.

Processes differ in the processor for which kernels are compiled, in threads, in the number of missions beside
the one that is compared, and in Python's hash seed; some are forked. Each plays several scenarios, because
its start and its kernels take most of its time.
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from functools import cache

import numpy as np

from benchmarks.proofs.cases import BrokenPromiseError, Found, walk
from benchmarks.proofs.drawn_scenarios import first_allowed
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.state_digest import state_digest

STEPS = 40
_PROCESSORS = ("", "generic", "haswell")
"""Values of NUMBA_CPU_NAME; empty = this processor."""
_PLAIN, *_OTHERS = itertools.product(_PROCESSORS, (1, 2), (1, 3))
"""Processor, threads and missions of processes; the first is what the others are compared with."""
VARIANTS = len(_OTHERS)
SCENARIOS_EACH = 10
"""Scenarios that a process plays."""


def play(number: int) -> Found:
    """Play some drawn scenarios in one variant, and compare them with the plain process.

    Raises:
        BrokenPromiseError: A state differs.
    """
    block, which = divmod(number, VARIANTS)
    first = block * SCENARIOS_EACH
    plain, other = _digests(first, _PLAIN), _digests(first, _OTHERS[which])
    differing = [first + place for place, digest in enumerate(other) if digest != plain[place]]
    if differing:
        raise BrokenPromiseError(f"scenarios {differing} end in another state in {_OTHERS[which]}")
    return Found({"plays of a scenario compared": len(other)})


@cache
def _digests(first: int, variant: tuple[str, int, int]) -> list[str]:
    """Return the digests of some scenarios, played in a fresh process."""
    processor, threads, missions = variant
    hash_seed = (first + len(processor) + 10 * threads + missions) % 2**32
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONHASHSEED": str(hash_seed)}
    if processor:
        variables |= {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
    if processor == "haswell":
        variables["NUMBA_CPU_FEATURES"] = "+avx2,+fma,+bmi,+bmi2"
    numbers = range(first, first + SCENARIOS_EACH)
    code = f"from {__name__} import print_digests; print_digests({numbers}, {threads}, {missions})"
    words = [sys.executable, "-W", "ignore", "-c", code]
    done = subprocess.run(words, env=variables, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BrokenPromiseError(f"exit code {done.returncode}: {done.stderr.strip()[-300:]}")
    return json.loads(done.stdout)


def print_digests(numbers: range, threads: int, missions: int) -> None:
    """Print the digests of some scenarios as JSON; processes with several missions are forked."""
    if missions > 1 and hasattr(os, "fork"):
        child = os.fork()
        if child:
            sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    print(json.dumps([digest_of(number, threads, missions) for number in numbers]))


def digest_of(number: int, threads: int, missions: int) -> str:
    """Return the digest of the first of some missions in a drawn scenario; the others are other episodes."""
    drawn, _ = first_allowed(number, few_kernels=True)
    team = Missions(drawn.scenario, missions, threads, drawn.given)
    team.reset_some(range(missions), [number] * missions)
    walk(team, np.random.default_rng(number), STEPS, alike=True)
    return state_digest(team, 0)
