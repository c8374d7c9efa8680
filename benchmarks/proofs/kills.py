"""Sweeps killed at drawn moments: nothing that was done is lost, and results are the same bytes.

A sweep is killed several times before its last mission, and then ends; everything that it writes, except
times on the clock, is compared with the files of an undisturbed one.
"""

from __future__ import annotations

import json
import lzma
import random
import tempfile
from functools import cache
from pathlib import Path

from benchmarks.proofs.cases import BrokenPromiseError, Command, Found

KILLS = 10
"""Of a sweep, in a case."""
_SWEEP = ("--scenarios", "box-7x11x5", "--robots", "1,2", "--time-limit-s", "150")
_WORDS = (*_SWEEP, "--strategies", "gradient", "--seeds", "6", "--jobs", "1")
_MISSIONS = 24
"""Two strategies (the baseline is added), two team sizes, six seeds."""


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
        _sweep(folder).kill_when(
            lambda target=target: len(_missions(folder)) >= target, moments.uniform(0.0, 0.01)
        )
        kept.append(len(_missions(folder)))
        if kept != sorted(kept) or kept[-1] >= _MISSIONS:
            raise BrokenPromiseError(f"a mission was lost, or the sweep ended before its kill: {kept}")
    _sweep(folder).finish()
    found = contents(folder)
    differing = [name for name in expected.keys() | found.keys() if expected.get(name) != found.get(name)]
    if differing:
        raise BrokenPromiseError(f"killed after {kept} missions, other bytes in {sorted(differing)}")
    return kept


@cache
def _undisturbed() -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        _sweep(Path(folder)).finish()
        return contents(Path(folder))


def _sweep(folder: Path) -> Command:
    return Command("baselines.benchmark", (*_WORDS, "--out", str(folder)))


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
