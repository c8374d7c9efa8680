"""The time from nothing to the first step, in fresh processes."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import entropy_explore_env
from benchmarks.rows import Effort, Goal, Row, alone, compared, timed

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
print(imported - began, stepped - imported, time.process_time())
"""
_TIMEOUT_S = 300.0
_OURS = Path(entropy_explore_env.__file__).parents[1]


class FirstStep(NamedTuple):
    """Seconds of a fresh process: in all, to import, to reset and step by the wall clock; of processors."""

    whole_s: float
    import_s: float
    step_s: float
    cpu_s: float


def startup_rows(effort: Effort, before: Path | None = None) -> list[Row]:
    """Import, reset and first step of `room`, interpreter start included: cached, and from nothing.

    Args:
        effort: How much is measured.
        before: The checkout of another version, whose first step takes turns with ours.
    """
    first_step()
    warm = [first_step() for _ in range(effort.starts)]
    cold, theirs = list[FirstStep](), list[FirstStep]()
    for _ in range(1 if before is None else effort.starts):
        for root, found in ((_OURS, cold), (before, theirs)):
            if root is not None:
                with tempfile.TemporaryDirectory() as empty:
                    found.append(first_step(empty, root))
    rows = []
    for starts, how, most_s in (
        (warm, "compiled code cached, no torch", 1.5),
        (cold, "nothing cached", 12.0),
    ):
        whole, imports, steps, _ = (list(column) for column in zip(*starts, strict=True))
        job = f"python start, import, reset, first step, {how}"
        rows += [
            alone(job, whole, "s", Goal("≤", most_s, "s")),
            alone(f"of that the import, {how}", imports, "s"),
            alone(f"of that the first reset and step, {how}", steps, "s"),
        ]
    if before is not None:
        job = "first step of all, nothing compiled, processor time"
        ours_s, theirs_s = [start.cpu_s for start in cold], [start.cpu_s for start in theirs]
        rows.append(compared(job, "version before", ours_s, theirs_s, "s", Goal("≤", 0.5)))
    return rows


def first_step(cache: str | None = None, root: Path = _OURS) -> FirstStep:
    """Time a fresh process from its start to the end of the first step.

    Args:
        cache: Folder of compiled code; None = the one that this process uses.
        root: The checkout whose code runs.

    Raises:
        RuntimeError: The process failed; the message is its last line.
    """
    paths = [str(root.resolve()), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = cache
    done: list[subprocess.CompletedProcess[str]] = []
    words = [sys.executable, "-c", _FIRST_STEP]

    def start() -> None:
        done.append(
            subprocess.run(
                words, cwd=root, env=environment, capture_output=True, text=True, timeout=_TIMEOUT_S
            )
        )

    taken = timed(start).wall_s
    if done[0].returncode != 0:
        raise RuntimeError("the first step failed: " + done[0].stderr.strip().splitlines()[-1])
    return FirstStep(taken, *map(float, done[0].stdout.split()))
