"""Changed files of every kind that the library and the trainers read: worlds, records, checkpoints.

Files of worlds are changed and read by `world_files`, in the reading process that reads them for people;
records and checkpoints by `saved_files`.
"""

from __future__ import annotations

import atexit
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.proofs.world_samples import samples
from benchmarks.reliability.saved_files import KINDS, play_files
from benchmarks.reliability.world_files import fuzz
from entropy_explore_env.worlds.files.process import ReaderProcess

BATCH = 500
"""Files of a case."""
FILES = 100_000
"""Asked for of each loader."""
WORLDS = (
    "octomap",
    "map_server",
    "image",
    "height png",
    "pcd",
    "ply",
    "obj",
    "stl",
    "glb",
    "height npz",
    "geotiff",
    "world npz",
)
"""Loaders of worlds, as `benchmarks.proofs.world_samples` names them."""
LOADERS = (*KINDS, *WORLDS)
CASES = len(LOADERS) * FILES // BATCH
_IN_MEMORY = "/dev/shm"
"""A folder in memory, on systems that have it there: to write a file takes longer than to refuse it."""


def play_number(number: int) -> dict[str, Any]:
    """Change and read the next batch of files of one loader; the loaders take turns."""
    batch, which = divmod(number, len(LOADERS))
    loader, seed = LOADERS[which], batch * len(LOADERS) + which
    in_memory = _IN_MEMORY if Path(_IN_MEMORY).is_dir() else None
    with tempfile.TemporaryDirectory(dir=in_memory) as folder:
        if loader in KINDS:
            kind = KINDS[loader](Path(folder))
            found = play_files(kind, Path(folder) / "changed", BATCH, seed)
        else:
            found = _play_worlds(loader, Path(folder), seed)
    wrong = found.pop("wrong")
    row = {"loader": loader, **found}
    return {**row, "failure": f"{loader}: " + "; ".join(wrong[:5])} if wrong else row


def _play_worlds(loader: str, folder: Path, seed: int) -> dict[str, Any]:
    found = asdict(fuzz(_samples()[loader], BATCH, seed, folder, _reader_of(loader)))
    del found["causes"]
    return {**found, "held_mib": found.pop("most_mib")}


_samples = cache(samples)


@cache
def _reader_of(loader: str) -> ReaderProcess:
    """The process that reads a loader's files, the same for all cases that are played in this one."""
    reader = ReaderProcess()
    atexit.register(reader.close)
    return reader


def plays_one_of(loaders: Sequence[str]) -> Callable[[int], bool]:
    """Whether a case is one of these loaders', by its number."""
    return lambda number: LOADERS[number % len(LOADERS)] in loaders


def files_of(row: dict[str, Any]) -> int:
    """What a case counts for; one that ended with an error of its own for nothing."""
    return row.get("files", 0)
