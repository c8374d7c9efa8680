"""Files are read in a separate process, so that a broken file can break only that process.

Most readers are third-party packages, which a hostile file may crash, keep busy or make use too much memory.
The process (`worker`) reads one file after another and is restarted when it has died; each file has limits of
processor time and memory. Usually the process reads one file; `kept_reader` keeps it for many. Windows has no
such limits: there elapsed time alone ends a process, and memory is not limited.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.command import READ_MEMORY_VARIABLE
from entropy_explore_env.errors import MissingExtraError, SettingError, WorldError
from entropy_explore_env.worlds.files.voxels import (
    MAX_FILE_BYTES,
    MAX_PIXELS,
    Voxels,
    memory_allowed,
)

MEMORY_BYTES = 448 << 20
"""Memory limit of the process, including its own 80 to 140 MiB, and more for each byte of the file."""
CPU_S = 1.5
CPU_S_PER_MIB = 20.0
"""Processor time that a file may take, and in addition for each MiB of it."""
_MOST_MEMORY_BYTES = 4 << 30
"""Memory limit of the largest files, unless another one is given."""
_PATIENCE = 10.0
"""Elapsed time per allowed processor time after which a process that waits is ended."""
_START_S = 60.0
_HEADER_BYTES = 1 << 16
_BOOT = """
import json, sys, types
sys.path[:], folder = json.loads(sys.argv[1])
sys.dont_write_bytecode = True
package = types.ModuleType("entropy_explore_env")  # in place of its __init__, which imports far more
package.__path__ = [folder]
sys.modules["entropy_explore_env"] = package
from entropy_explore_env.worlds.files.worker import serve
serve()
"""


class Format(NamedTuple):
    """A file format: the module that reads it, and its name in errors."""

    reader: str
    kind: str
    memory_per_byte: int = 16
    """How much more memory a file may take for each of its bytes."""


class Limits(NamedTuple):
    """What reading a file may take; None = by the file's size."""

    cpu_s: float | None = None
    """Processor time."""
    memory_mib: float | None = None
    """Memory of the process, its own 80 to 140 MiB included."""


USUAL = Limits()


def _memory_bytes(limits: Limits, form: Format, size: int) -> int:
    """Return the memory limit for a file of this many bytes."""
    mib: Any = limits.memory_mib
    if mib is None:
        mib = os.environ.get(READ_MEMORY_VARIABLE)
    if mib is None:
        return min(MEMORY_BYTES + form.memory_per_byte * size, _MOST_MEMORY_BYTES)
    try:
        allowed = float(mib) * (1 << 20)
    except ValueError:
        allowed = math.nan
    if not 0 < allowed < 2**62:
        raise SettingError(READ_MEMORY_VARIABLE, mib, "a number of MiB > 0")
    return int(allowed)


class ReaderProcess:
    """A process that reads files; started at the first file, and again after it has died.

    Attributes:
        cost: Of the latest answer, or None if the process died: `cpu_s`, processor time since its
            start, and `peak_kib`, its peak memory, NaN where the system does not tell it.
    """

    def __init__(self) -> None:
        """Start nothing yet."""
        self._process: subprocess.Popen[bytes] | None = None
        self.cost: dict[str, float] | None = None

    def read(
        self, form: Format, path: Path | str, options: Mapping[str, Any], limits: Limits = USUAL
    ) -> Voxels:
        """Return the voxels in a file.

        Args:
            form: The file's format.
            path: The file.
            options: Settings for the reader; None = not given.
            limits: Of time and memory.

        Raises:
            WorldError: The file is missing, too large, broken, or takes too long or too much memory.
            SettingError: A setting is missing or does not apply to this format.
            MissingExtraError: The package that reads it is not installed.
        """
        size = _size(path)
        allowed_s = CPU_S + CPU_S_PER_MIB * size / (1 << 20) if limits.cpu_s is None else limits.cpu_s
        request = {
            "reader": form.reader,
            "kind": form.kind,
            "path": str(path),
            "options": dict(options),
            "cpu_s": allowed_s,
            "memory_bytes": _memory_bytes(limits, form, size),
        }
        process = self._running()
        ended = threading.Event()

        def end() -> None:
            ended.set()  # Windows has no signals, so that its exit code tells nothing
            process.kill()

        timer = threading.Timer(_START_S + _PATIENCE * allowed_s, end)
        timer.start()
        try:
            answer = _ask(process, request)
        except BaseException:
            self.close()
            raise
        finally:
            timer.cancel()
        if answer is None:
            raise WorldError("world file", str(path), self._cause_of_death(form, request, ended.is_set()))
        header, arrays = answer
        self.cost = {"cpu_s": header["cpu_s"], "peak_kib": header["peak_kib"]}
        _raise_error(header, form, path)
        x, y, z = header["origin_m"]
        ceiling = arrays[1] if len(arrays) > 1 else None
        return Voxels(
            arrays[0],
            header["voxel_size_m"],
            (x, y, z),
            header["yaw_rad"],
            ceiling,
            header["name"],
            tuple(header["notes"]),
        )

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                with contextlib.suppress(OSError):
                    pipe.close()  # type: ignore[union-attr]

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None or self._process.poll() is not None:
            self.close()
            package = Path(__file__).parents[2]
            about = json.dumps([[entry for entry in sys.path if entry], str(package)])
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-c", _BOOT, about],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            )
        return self._process

    def _cause_of_death(self, form: Format, request: Mapping[str, Any], ended: bool) -> str:
        """Return what is allowed, in the terms of an error: a file that does not end the process.

        Args:
            form: The file's format.
            request: What was asked.
            ended: Whether we ended the process because it took too long.
        """
        assert self._process is not None
        code = self._process.wait()
        self.close()
        self.cost = None
        slow = code in (-getattr(signal, "SIGPROF", 27), -getattr(signal, "SIGKILL", 9))
        if ended or slow:
            within = f"read within {request['cpu_s']:.3g} s of computing"
            return f"a file that is {within} (read_limit_s, --read-limit-s, allows more)"
        if code == -signal.SIGABRT:  # libraries in C++ end so where there is no more memory
            return f"a whole {form.kind} that is {memory_allowed(request['memory_bytes'])}"
        return f"a whole {form.kind}"


def _size(path: Path | str) -> int:
    """Return the bytes of a file; 0 for a name.

    Raises:
        WorldError: It is missing or too large.
    """
    if isinstance(path, str):
        return 0
    if not path.is_file():
        raise WorldError("world file", str(path), "a file that exists")
    size = path.stat().st_size
    if size > MAX_FILE_BYTES:
        raise WorldError("world file", str(path), f"at most {MAX_FILE_BYTES >> 30} GiB")
    return size


def _ask(
    process: subprocess.Popen[bytes], request: dict[str, Any]
) -> tuple[dict[str, Any], list[np.ndarray]] | None:
    """Return the header and arrays of the answer; None if the process died."""
    assert process.stdin is not None and process.stdout is not None
    try:
        process.stdin.write(json.dumps(request).encode() + b"\n")
        process.stdin.flush()
    except OSError:
        return None
    line = process.stdout.readline(_HEADER_BYTES)
    if not line.endswith(b"\n"):
        process.kill()
        return None
    header, arrays = json.loads(line), []
    for shape, dtype in zip(header.get("shapes", ()), (np.int8, np.int32), strict=False):
        if math.prod(shape) > MAX_PIXELS:
            process.kill()
            return None
        array = np.empty(shape, dtype)
        if process.stdout.readinto(memoryview(array).cast("B")) != array.nbytes:  # type: ignore[attr-defined]
            return None
        arrays.append(array)
    return header, arrays


def _raise_error(header: dict[str, Any], form: Format, path: Path | str) -> None:
    """Raise the error that an answer holds, if it holds one."""
    if "refused" in header:
        raise WorldError("world file", str(path), header["refused"] or f"a whole {form.kind}")
    if "missing" in header:
        raise MissingExtraError(*header["missing"])
    if "setting" in header:
        raise SettingError(*header["setting"])


_KEPT: ContextVar[ReaderProcess | None] = ContextVar("_KEPT", default=None)


@contextlib.contextmanager
def kept_reader(reader: ReaderProcess | None = None) -> Iterator[ReaderProcess]:
    """Read all files inside this block in one process, which saves its starts; yields that process.

    Args:
        reader: One that goes on after the block; None = a new one, which ends with it.
    """
    one = reader or ReaderProcess()
    token = _KEPT.set(one)
    try:
        yield one
    finally:
        _KEPT.reset(token)
        if reader is None:
            one.close()


def read_apart(form: Format, path: Path | str, options: Mapping[str, Any], limits: Limits = USUAL) -> Voxels:
    """Read a file in the process of `kept_reader`, or in one for this file; see ReaderProcess.read."""
    kept = _KEPT.get()
    if kept is not None:
        return kept.read(form, path, options, limits)
    with kept_reader() as reader:
        return reader.read(form, path, options, limits)
