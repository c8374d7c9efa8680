"""Compile ahead of time what missions need: `python -m entropy_explore_env warm [SCENARIO ...]`.

Without scenarios, all of them. Compiled kernels are kept in NUMBA_CACHE_DIR, or in the user's cache folder.
Strategies compile their own at their first decision.

What was compiled goes to standard output, errors in one line to standard error. Exit codes: 0 done, 2 bad
input, 130 interrupted.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import NamedTuple

from entropy_explore_env.command import LineParser
from entropy_explore_env.compilation.announcement import compiled_kernels, short_path
from entropy_explore_env.compilation.folder import kernel_folder
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError, counted, one_of
from entropy_explore_env.settings.scenarios import SCENARIOS

_MAX_PROCESSES = 256


class Warmed(NamedTuple):
    """What a scenario needed."""

    scenario: str
    compiled: int
    seconds: float


def main(words: Sequence[str]) -> int:
    """Run the command; the exit code."""
    args = _parser().parse_args(words)
    names = list(dict.fromkeys(args.scenarios)) or list(SCENARIOS)
    for name in names:
        if name not in SCENARIOS:
            raise SettingError("scenario", name, one_of(name, SCENARIOS))
    if not 1 <= args.processes <= _MAX_PROCESSES:
        raise SettingError("processes", args.processes, f"a whole number from 1 to {_MAX_PROCESSES}")
    folder = _writable_folder()
    began = time.perf_counter()
    done = []
    for warmed in _in_processes(names, min(args.processes, len(names))):
        done.append(warmed)
        if warmed.compiled:
            print(
                f"{warmed.scenario}: compiled {counted(warmed.compiled, 'kernel')}, {warmed.seconds:.1f} s",
                flush=True,
            )
    compiled = sum(warmed.compiled for warmed in done)
    if compiled:
        taken = time.perf_counter() - began
        print(
            f"Compiled {counted(compiled, 'kernel')} in {taken:.1f} s; they are kept in {short_path(folder)}."
        )
    else:
        print(f"Nothing left to compile: all kernels are in {short_path(folder)}.")
    return 0


def _parser() -> argparse.ArgumentParser:
    kind = argparse.RawDescriptionHelpFormatter
    parser = LineParser(prog="python -m entropy_explore_env warm", description=__doc__, formatter_class=kind)
    parser.add_argument("scenarios", nargs="*", metavar="SCENARIO", help="such as room; default: all")
    parser.add_argument(
        "--processes", type=int, default=os.cpu_count() or 1, metavar="N", help="default: one for each core"
    )
    return parser


def _writable_folder() -> Path:
    folder = kernel_folder()
    if folder is None:
        raise SettingError("NUMBA_CACHE_DIR", None, "a folder, where the user has no home folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        allowed = f"a folder that can be written ({error.strerror}); compiled kernels would not be kept"
        raise SettingError("NUMBA_CACHE_DIR", str(folder), allowed) from None


def _in_processes(names: list[str], processes: int) -> list[Warmed]:
    """Warm scenarios, in processes of their own; whichever is done first comes first.

    The first scenario is warmed before the others: they find the kernels that all share.
    """
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=fresh) as pool:
        done = [pool.submit(warm, names[0]).result()]
        return done + [future.result() for future in as_completed([pool.submit(warm, n) for n in names[1:]])]


def warm(name: str) -> Warmed:
    """Run a mission of a scenario for one step."""
    before, began = len(compiled_kernels()), time.perf_counter()
    env = EntropyExploreEnv(name)
    env.reset(seed=0)
    env.step({agent: env.action_space(agent).sample() for agent in env.agents})
    env.close()
    return Warmed(name, len(compiled_kernels()) - before, time.perf_counter() - began)
