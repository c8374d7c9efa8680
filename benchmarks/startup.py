"""The time from nothing to the first step, in fresh processes."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import entropy_explore_env
from benchmarks.rows import Effort, Goal, Row, alone

_FIRST_STEP = """
import sys
import entropy_explore_env
env = entropy_explore_env.parallel_env("room")
env.reset(seed=0)
env.step({agent: env.action_space(agent).sample() for agent in env.agents})
assert "torch" not in sys.modules, "torch was imported"
"""
_TIMEOUT_S = 300.0
_OURS = Path(entropy_explore_env.__file__).parents[1]


def startup_rows(effort: Effort) -> list[Row]:
    """Return rows of a fresh process's seconds, interpreter start included: cached, and from nothing."""
    first_step()
    warm = [first_step() for _ in range(effort.starts)]
    with tempfile.TemporaryDirectory() as empty:
        cold = first_step(empty)
    job = "python start, import, reset, first step"
    return [
        alone(f"{job}, compiled code cached, no torch", warm, "s", Goal("≤", 1.5, "s")),
        alone(f"{job}, nothing cached", [cold], "s", Goal("≤", 12.0, "s")),
    ]


def first_step(cache: str | None = None) -> float:
    """Return the seconds by the wall clock from the start of a fresh process to the end of a first step.

    Args:
        cache: Folder of compiled code; None = the one that this process uses.

    Raises:
        RuntimeError: The process failed; the message is its last line.
    """
    paths = [str(_OURS), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = cache
    words = [sys.executable, "-c", _FIRST_STEP]
    began = time.perf_counter()
    done = subprocess.run(
        words, cwd=_OURS, env=environment, capture_output=True, text=True, timeout=_TIMEOUT_S
    )
    taken_s = time.perf_counter() - began
    if done.returncode != 0:
        raise RuntimeError("the first step failed: " + done.stderr.strip().splitlines()[-1])
    return taken_s
