"""Sweeps killed at drawn moments: nothing that was done is lost, and results are the same bytes.

A sweep is killed several times before its last mission, and then ends; everything that it writes, except
times on the clock, is compared with the files of an undisturbed one.
"""

from __future__ import annotations

import io
import json
import lzma
import os
import random
import signal
import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path

from benchmarks.proofs.cases import BrokenPromiseError, Found

KILLS = 10
"""Of a sweep, in a case."""
_SWEEP = ("--scenarios", "box-7x11x5", "--robots", "1,2", "--time-limit-s", "150")
_WORDS = (*_SWEEP, "--strategies", "gradient", "--seeds", "6", "--jobs", "1")
_MISSIONS = 24
"""Two strategies (the baseline is added), two team sizes, six seeds."""
_WAIT_S = 300.0


def play(number: int) -> Found:
    """Kill a sweep KILLS times.

    Raises:
        BrokenPromiseError: Something was lost, or came out otherwise.
    """
    with tempfile.TemporaryDirectory() as folder:
        kill_sweep(Path(folder), random.Random(number))
    return Found({"kills": KILLS})


def kill_sweep(folder: Path, moments: random.Random) -> list[int]:
    """Kill a sweep; returns the number of missions that were kept each time."""
    expected, kept = _undisturbed(), list[int]()
    for target in sorted(moments.sample(range(_MISSIONS - 1), KILLS)):
        child = _start(lambda: _sweep(folder))
        _until(lambda target=target: len(_missions(folder)) >= target, child)
        time.sleep(moments.uniform(0.0, 0.01))
        _kill(child)
        kept.append(len(_missions(folder)))
        if kept != sorted(kept):
            raise BrokenPromiseError(f"a mission was lost: {kept}")
        if kept[-1] >= _MISSIONS:
            raise BrokenPromiseError("the sweep had ended before it was killed: no kill at all")
    _sweep(folder)
    found = contents(folder)
    differing = [name for name in expected.keys() | found.keys() if expected.get(name) != found.get(name)]
    if differing:
        raise BrokenPromiseError(f"killed after {kept} missions, other bytes in {sorted(differing)}")
    return kept


@cache
def _undisturbed() -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        _sweep(Path(folder))
        return contents(Path(folder))


def _sweep(folder: Path) -> None:
    from baselines import benchmark
    from baselines.cli.arguments import run_command

    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        code = run_command(benchmark.main, [*_WORDS, "--out", str(folder)])
    if code:
        raise BrokenPromiseError(f"the sweep ended with exit code {code}")


def _missions(folder: Path) -> list[bytes]:
    """Return the whole rows of the tables that grow."""
    return [row for table in folder.rglob("*.jsonl") for row in table.read_bytes().split(b"\n")[:-1]]


def contents(folder: Path) -> dict[str, bytes]:
    """Return all that a sweep wrote, except missions, times on the clock and half-written files."""
    return {
        str(path.relative_to(folder)): _without_clock(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and "runs" not in path.parts and path.name[0] != "."
    }


def _without_clock(path: Path) -> bytes:
    """Return the content of a file without seconds on the clock."""
    if path.suffix != ".xz":
        return path.read_bytes()
    missions = [json.loads(line) for line in lzma.decompress(path.read_bytes()).splitlines()]
    for mission in missions:
        mission["record"].pop("clock", None)  # what failed has none
    return json.dumps(missions).encode()


def _start(work: Callable[[], None]) -> int:
    """Do work in a forked process, which shares imports and kernels; returns its number."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            work()
            code = 0
        finally:
            os._exit(code)
    return child


def _until(happened: Callable[[], bool], child: int) -> None:
    """Wait until something has happened, or the process has ended.

    Raises:
        BrokenPromiseError: Neither comes.
    """
    begun_s = time.monotonic()
    while not happened() and os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        if time.monotonic() - begun_s > _WAIT_S:
            _kill(child)
            raise BrokenPromiseError(f"nothing happened for {_WAIT_S:g} s")
        time.sleep(0.0005)


def _kill(child: int) -> None:
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
