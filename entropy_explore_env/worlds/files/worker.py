"""The process that files are read in: answers one request after another until its input ends.

A request is a line of JSON: reader, path, options, `cpu_s` and `memory_bytes`. The answer is a line of JSON
with the numbers of a Voxels, or with the error to raise, and after it the bytes of its arrays. A reader that
needs more time is ended by the system's timer, one that needs more memory by its limit. A broken file can
break only this process, which cannot write files. To start fast it does not import the package's own
`__init__` (see `process`). Windows has neither limits nor timer: there a process ends only by its parent's
clock, its memory is not limited, and it could write files.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from entropy_explore_env.errors import MissingExtraError, SettingError, imported
from entropy_explore_env.worlds.files.voxels import Options, RefusedError, Voxels, memory_allowed

try:
    import resource
except ImportError:  # Windows
    resource = None

_READERS = "entropy_explore_env.worlds.files."


def serve() -> None:
    """Answer requests on standard input; what readers print is discarded."""
    answers = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    if resource is not None:
        for limit in (resource.RLIMIT_FSIZE, resource.RLIMIT_CORE):
            resource.setrlimit(limit, (0, resource.getrlimit(limit)[1]))
    for line in sys.stdin.buffer:
        _send(answers, *_answer(json.loads(line)))


def _answer(request: dict[str, Any]) -> tuple[dict[str, Any], list[np.ndarray]]:
    """Return the header and arrays of the answer to a request."""
    try:
        reader = importlib.import_module(_READERS + request["reader"])
        for module, package in reader.NEEDS:  # before the reader's time is measured
            imported(module, package, "baselines" if package == "matplotlib" else "worlds")
        voxels = _read(reader, request)
    except RefusedError as error:
        return {"refused": str(error)}, []
    except MissingExtraError as error:
        return {"missing": [error.package, error.extra]}, []
    except SettingError as error:
        return {"setting": [error.field, error.value, error.allowed]}, []
    except MemoryError:
        return {"refused": f"a file that is {memory_allowed(request['memory_bytes'])}"}, []
    except Exception:  # readers raise whatever a broken file leads them to
        return {"refused": None}, []
    arrays = [voxels.labels] if voxels.ceiling is None else [voxels.labels, voxels.ceiling]
    header = {
        "shapes": [list(array.shape) for array in arrays],
        "voxel_size_m": voxels.voxel_size_m,
        "origin_m": voxels.origin_m,
        "yaw_rad": voxels.yaw_rad,
        "name": voxels.name,
        "notes": voxels.notes,
    }
    return header, arrays


def _read(reader: Any, request: dict[str, Any]) -> Voxels:  # noqa: ANN401 - a module
    options = Options(request["options"])
    _limit_memory(request["memory_bytes"])
    _limit_time(request["cpu_s"])
    try:
        voxels = reader.read(Path(request["path"]), options)
        options.refuse_unused(request["kind"])
        numbers = (voxels.voxel_size_m, *voxels.origin_m, voxels.yaw_rad)
        if not all(math.isfinite(number) for number in numbers):
            raise RefusedError("a map whose place and size are finite")
        return voxels
    finally:
        _limit_time(0.0)


def _limit_time(cpu_s: float) -> None:
    """Let this process end after so much processor time, where the system has a timer for it; 0 = never."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, cpu_s)  # its signal ends the process


def _limit_memory(most_bytes: int) -> None:
    """Limit the memory of this process, where the system has limits and tells how much it uses."""
    if resource is None:
        return
    try:
        mapped, resident = (int(pages) for pages in Path("/proc/self/statm").read_text().split()[:2])
    except OSError:
        return
    page = resource.getpagesize()  # mapped but not resident: libraries
    most = mapped * page + max(most_bytes - resident * page, 0)
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _peak_kib() -> float:
    """Return the peak memory of this process, NaN where the system does not tell it.

    `ru_maxrss` would include that of the process which started it.
    """
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:  # not every system has it
        return math.nan if resource is None else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(status.split("VmHWM:")[1].split()[0])


def _send(answers: BinaryIO, header: dict[str, Any], arrays: list[np.ndarray]) -> None:
    """Write an answer, with the processor time and memory used so far."""
    header |= {"cpu_s": time.process_time(), "peak_kib": _peak_kib()}
    answers.write(json.dumps(header).encode() + b"\n")
    for array in arrays:
        answers.write(np.ascontiguousarray(array).data)
    answers.flush()
