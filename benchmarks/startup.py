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
import sys, time
began = time.perf_counter()
import entropy_explore_env
imported = time.perf_counter()
env = entropy_explore_env.parallel_env("room")
env.reset(seed=0)
env.step({agent: env.action_space(agent).sample() for agent in env.agents})
stepped = time.perf_counter()
assert "torch" not in sys.modules, "torch was imported"
print(imported - began, stepped - imported)
"""
_TIMEOUT_S = 300.0
_OURS = Path(entropy_explore_env.__file__).parents[1]


def startup_rows(effort: Effort) -> list[Row]:
    """Import, reset and first step of `room`, interpreter start included: cached, and from nothing."""
    first_step()
    warm = [first_step() for _ in range(effort.starts)]
    with tempfile.TemporaryDirectory() as empty:
        cold = [first_step(empty)]
    rows, kept = [], "compiled code cached, no torch"
    for starts, how, most_s in ((warm, kept, 1.5), (cold, "nothing cached", 12.0)):
        whole, imports, steps = (list(column) for column in zip(*starts, strict=True))
        job = f"python start, import, reset, first step, {how}"
        rows += [
            alone(job, whole, "s", Goal("≤", most_s, "s")),
            alone(f"of that the import, {how}", imports, "s"),
            alone(f"of that the first reset and step, {how}", steps, "s"),
        ]
    return rows


def first_step(cache: str | None = None) -> list[float]:
    """Return seconds of a fresh process by the wall clock: from start to first step, to import, and to step.

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
    whole_s = time.perf_counter() - began
    if done.returncode != 0:
        raise RuntimeError("the first step failed: " + done.stderr.strip().splitlines()[-1])
    return [whole_s, *map(float, done.stdout.split())]
