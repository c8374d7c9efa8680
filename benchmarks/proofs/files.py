"""Changed files of every format that the library and the trainers read: worlds, records, checkpoints.

Each is read or refused by a named error of one line, in little time and memory; nothing in it runs, and
nothing outside its folder is read.
"""

from __future__ import annotations

import atexit
import contextlib
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.proofs.cases import BrokenPromiseError, Found
from benchmarks.proofs.hostile_worlds import mutant
from benchmarks.proofs.saved_files import SAVED
from benchmarks.proofs.world_samples import SAMPLES
from entropy_explore_env.errors import EntropyExploreError, WorldWarning
from entropy_explore_env.worlds.files.process import CPU_S, ReaderProcess, kept_reader
from entropy_explore_env.worlds.load import load_world

try:
    import resource
except ImportError:  # Windows
    resource = None

BATCH = 500
"""Files of a case."""
FORMATS = (*SAVED, *SAMPLES)
_OUTSIDE_SHAPE = (3, 2, 1)
"""Of a file that must not be read; no changed sample has it."""
MOST_S, MOST_SAVED_S = 3.0, 5.0
"""Most processor time for a world's file, with the start of a process that reads it, and for a record or
checkpoint and what it describes."""
MOST_READER_MIB, MOST_GROWTH_MIB = 512, 1024
"""Most memory of the process that reads worlds, and most growth of this one, which makes them."""
_MOST_ERROR = 1000
"""Letters of an error."""
_IN_MEMORY = "/dev/shm"
"""Folder in memory, where the system has it: to write a file takes longer than to refuse it."""


@dataclass
class Reads:
    """What became of the files of a format."""

    files: int = 0
    loaded: int = 0
    ended: int = 0
    """Files that ended the process which reads them."""
    most_s: float = 0.0
    most_mib: float = 0.0
    wrong: list[str] = field(default_factory=list)


def play(number: int) -> Found:
    """Change and read a batch of files of one format; formats take turns.

    Raises:
        BrokenPromiseError: Some were treated wrongly.
    """
    name = FORMATS[number % len(FORMATS)]
    in_memory = _IN_MEMORY if Path(_IN_MEMORY).is_dir() else None
    with tempfile.TemporaryDirectory(dir=in_memory) as folder:
        if name in SAVED:
            reads = read_saved(name, Path(folder), BATCH, number)
        else:
            reads = read_worlds(name, Path(folder), BATCH, number, _reader())
    if reads.wrong:
        raise BrokenPromiseError(f"{name}: {len(reads.wrong)} files: " + "; ".join(reads.wrong[:5]))
    counts = {"read": reads.loaded, "refused": reads.files - reads.loaded, "of these ended": reads.ended}
    return Found({**counts, "s at most": reads.most_s, "MiB at most": reads.most_mib}, name)


@cache
def _reader() -> ReaderProcess:
    """Return the process that reads all worlds of this process."""
    reader = ReaderProcess()
    atexit.register(reader.close)
    return reader


def read_saved(name: str, folder: Path, count: int, seed: int) -> Reads:
    """Change and read records or checkpoints; see `read_changed`."""
    saved = SAVED[name](folder)
    with _little_memory():
        return read_changed(saved.changed, saved.load, folder / "changed", count, seed, MOST_SAVED_S)


def read_worlds(name: str, folder: Path, count: int, seed: int, reader: ReaderProcess | None = None) -> Reads:
    """Change and read world files, in an empty folder beside a file that must not be read.

    See `read_changed`; a reader that is given goes on afterwards.
    """
    inside, sources = folder / "maps", SAMPLES[name]()
    (inside / "sub").mkdir(parents=True)
    secret = folder / "outside.pgm"
    secret.write_bytes(b"P5\n%d %d\n255\n" % _OUTSIDE_SHAPE[:2] + b"\xfe" * 6)
    with contextlib.suppress(OSError):  # not everybody may make links on Windows
        (inside / "link.pgm").symlink_to(secret)
        (inside / "linked").symlink_to(folder)
    change, load = partial(mutant, sources), partial(_load_world, sources[0].options)
    with kept_reader(reader) as kept:
        return read_changed(change, load, inside, count, seed, MOST_S, kept)


def _load_world(options: dict[str, Any], path: Path) -> None:
    """Load a world.

    Raises:
        BrokenPromiseError: It ran code, or read a file outside the folder.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", WorldWarning)
            world = load_world(path, **options)
    finally:
        if path.with_name("executed").exists() or Path("executed").exists():
            raise BrokenPromiseError("ran code")
    if world.grid.shape == _OUTSIDE_SHAPE:
        raise BrokenPromiseError("read a file outside")


def read_changed(
    change: Callable[[int, np.random.Generator], tuple[str, dict[str, bytes]]],
    load: Callable[[Path], object],
    folder: Path,
    count: int,
    seed: int,
    most_s: float,
    reader: ReaderProcess | None = None,
) -> Reads:
    """Change files, load them in a process or in this one, and note what is wrong with how they were treated.

    `change` returns what is done to the files by name, and the files with it; `load` takes the path of the
    first of them in the folder. Each may take `most_s` of the processor.
    """
    reads, there = Reads(), dict[str, bytes]()
    folder.mkdir(exist_ok=True)
    before_mib = _peak_mib()
    for number in range(count):
        what, files = change(number, np.random.default_rng([seed, number]))
        for name, content in files.items():
            if there.get(name) != content:
                (folder / name).write_bytes(content)
                there[name] = content
        reads.files += 1
        complaint = _read(partial(load, folder / next(iter(files))), most_s, reader, reads)
        if complaint:
            reads.wrong.append(f"[{seed}, {number}] {what}: {complaint[:200]}")
    grown_mib = _peak_mib() - before_mib
    if reader is None:
        reads.most_mib = grown_mib
    if grown_mib > MOST_GROWTH_MIB:
        reads.wrong.append(f"this process grew by {grown_mib:.0f} MiB")
    return reads


def _read(load: Callable[[], object], most_s: float, reader: ReaderProcess | None, reads: Reads) -> str:
    """Load files; returns what is wrong with how they were treated, or an empty text."""
    earlier_s = reader.cost["cpu_s"] if reader is not None and reader.cost else 0.0
    if reader is not None:
        reader.cost = None
    complaint, begun_s = "", time.process_time()
    try:
        load()
        reads.loaded += 1
    except EntropyExploreError as error:
        if "\n" in str(error) or len(str(error)) > _MOST_ERROR:
            complaint = "an error of more than a line"
    except Exception as error:
        complaint = f"{type(error).__name__}: {error}"
    spent_s = time.process_time() - begun_s
    if reader is not None and reader.cost is None:
        reads.ended += 1
        spent_s += CPU_S
    elif reader is not None and reader.cost is not None:
        later_s = reader.cost["cpu_s"]
        spent_s += later_s - earlier_s if later_s >= earlier_s else later_s
        peak_mib = reader.cost["peak_kib"] / 1024  # of the process's life: a file is blamed if it raised it
        if peak_mib > max(MOST_READER_MIB, reads.most_mib):
            complaint = complaint or f"{peak_mib:.0f} MiB"
        reads.most_mib = max(reads.most_mib, peak_mib)
    reads.most_s = max(reads.most_s, spent_s)
    return complaint or (f"{spent_s:.2f} s" if spent_s > most_s else "")


def _peak_mib() -> float:
    """Return the most resident memory that this process ever held; 0 where the system does not tell."""
    if resource is None:
        return 0.0
    unit = 2**20 if sys.platform == "darwin" else 2**10  # macOS counts bytes, Linux KiB
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


@contextlib.contextmanager
def _little_memory() -> Iterator[None]:
    """Let the process take at most 4 GiB more than it has, on Linux, so that a file cannot take all of it."""
    told = Path("/proc/self/statm")
    if resource is None or not told.exists():
        yield
        return
    pages = int(told.read_text("ascii").split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + (4 << 30), before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
