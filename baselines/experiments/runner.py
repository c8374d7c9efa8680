"""Runs work whose results are kept in files: what was stopped goes on where it was.

Each result is one small file, written whole or not at all, under a digest of all that decides it: its
settings and the meaning of the code. What has a file of the same digest is not run again.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import re
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from baselines.experiments.outcome import Outcome, Record
from baselines.experiments.provenance import CodeChangedError
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.worker_pool import Failure, run_each
from entropy_explore_env.writing import write_atomically

_PACE_PERIOD_S = 600.0
"""The bar estimates the time left from so much of the past: single missions differ a lot."""
_LONGEST_REASON = 200
_NO_COLONS = os.name == "nt"
TRACE = "trace"
"""In records of work that failed: where, with folders of the machine that ran it."""
NOT_RUN: Record = {"not_run": True}
"""In place of the record of work that was not begun."""
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
"""Where an object lies: another place in every process."""

Item = TypeVar("Item")


class Work(Protocol):
    """A piece of an experiment; it can be pickled."""

    @property
    def file(self) -> str:
        """Its file in the folder of results, without suffix."""
        ...

    @property
    def settings_digest(self) -> str:
        """Of all that decides the result but the code."""
        ...

    def code_digest(self) -> str:
        """Of the code that this process would run it with."""
        ...

    def run(self) -> Outcome:
        """Do it."""
        ...


@dataclass(frozen=True)
class Conditions:
    """How work is run.

    Attributes:
        folder: For the files.
        workers: Processes of this machine, or a Ray cluster; with one process the work is done in this one.
        title: Of the progress bar.
        quiet: Show no bar.
        limit_s: Of every piece of work, on the clock; see `worker_pool.run_each`.
        keep_failures: Work that fails leaves the record of `failed_record`; else its error is raised.
        stop_after_s: When so much time has passed on the clock no more work is begun; what is left has the
            record NOT_RUN.
    """

    folder: Path
    workers: int | RayCluster
    title: str
    quiet: bool
    limit_s: float = math.inf
    keep_failures: bool = False
    stop_after_s: float = math.inf


@dataclass(frozen=True)
class _Order:
    """Work for a worker, and the code that it is to be done with."""

    work: Work
    code: str


def run_all(works: Sequence[Work], conditions: Conditions) -> list[Record]:
    """Run what is missing of some work, under a progress bar on standard error.

    Returns:
        The record of each, in the same order; NOT_RUN where the time was up.

    Raises:
        CodeChangedError: The code was edited meanwhile, so that a new process would run other code than those
            that began; what is done stays.
    """
    ends_s = time.monotonic() + conditions.stop_after_s
    codes = [work.code_digest() for work in works]
    records = [
        read_record(conditions.folder, work, code, conditions.limit_s)
        for work, code in zip(works, codes, strict=True)
    ]
    missing = [place for place, record in enumerate(records) if record is None]
    orders = [_Order(works[place], codes[place]) for place in missing]
    places = {id(order): place for order, place in zip(orders, missing, strict=True)}
    results = run_each(
        _fulfil, orders if ends_s > time.monotonic() else [], conditions.workers, conditions.limit_s
    )
    for order, result in _progressing(results, len(works) - len(missing), len(works), conditions):
        if isinstance(result, Failure):
            if not conditions.keep_failures or isinstance(result.error, CodeChangedError):
                result.throw()
            result = Outcome(failed_record(result, conditions.limit_s))
        _write(conditions.folder, order, result)
        records[places[id(order)]] = result.record
        if time.monotonic() > ends_s:
            results.close()
            break
    return [NOT_RUN if record is None else record for record in records]


def _fulfil(order: _Order) -> Outcome:
    """Do work in this process, if it has the code that the experiment began with."""
    if order.work.code_digest() != order.code:
        raise CodeChangedError(
            f"code that makes {order.work.file} was edited after the experiment began: start it again; "
            "what is done stays"
        )
    return order.work.run()


def _progressing(results: Iterator[Item], done: int, total: int, conditions: Conditions) -> Iterator[Item]:
    """Pass results on under a progress bar on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(file=sys.stderr)
    with Progress(
        *columns, console=console, disable=conditions.quiet, speed_estimate_period=_PACE_PERIOD_S
    ) as progress:
        task = progress.add_task(conditions.title, total=total, completed=done)
        for result in results:
            progress.advance(task)
            yield result


def failed_record(failure: Failure, limit_s: float) -> Record:
    """What is kept of work that failed.

    Returns:
        `failed`, the reason; `trace`, where it was; and `limit_s` of work that ran past it, which a longer
        limit runs again.
    """
    reason = _ADDRESS.sub(" at 0x…", failure.reason)
    reason = reason if len(reason) <= _LONGEST_REASON else reason[:_LONGEST_REASON] + " …"
    return {"failed": reason, TRACE: failure.trace, "limit_s": limit_s if failure.late else None}


def kept_file(folder: Path, name: str, suffix: str = ".json") -> Path:
    """Where the result of work is kept: its name may hold a colon, which no file of Windows may."""
    return folder / f"{name.replace(':', '_') if _NO_COLONS else name}{suffix}"


def result_digest(work: Work, code: str) -> str:
    """Under which a result is kept."""
    return hashlib.sha256(f"{work.settings_digest} {code}".encode()).hexdigest()[:16]


def _write(folder: Path, order: _Order, outcome: Outcome) -> None:
    if outcome.arrays:
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, **outcome.arrays)
        write_atomically(kept_file(folder, order.work.file, ".npz"), buffer.getvalue())
    write_record(folder, order.work, order.code, outcome.record)


def write_record(folder: Path, work: Work, code: str, record: Record) -> None:
    """Keep the record of work that was done with some code."""
    content = {
        "digest": result_digest(work, code),
        "settings": work.settings_digest,
        "code": code,
        "checksum": _checksum(record),
        "record": record,
    }
    write_atomically(kept_file(folder, work.file), json.dumps(content, allow_nan=False))


def without_trace(content: dict[str, Any]) -> dict[str, Any]:
    """What the file of some work holds, but where it failed: for others, on other machines."""
    if not content["record"].get(TRACE):
        return content
    record = {**content["record"], TRACE: ""}
    return {**content, "record": record, "checksum": _checksum(record)}


def _checksum(record: object) -> str:
    """Of a record, so that one that was changed by hand is run again."""
    return hashlib.sha256(json.dumps(record).encode()).hexdigest()[:16]


def read_record(folder: Path, work: Work, code: str, limit_s: float = math.inf) -> Record | None:
    """The record of work with these settings and this code that was not ended by a shorter limit."""
    content = kept_content(folder, work)
    if content.get("digest") != result_digest(work, code):
        return None
    ended_after_s = content["record"].get("limit_s")
    return None if ended_after_s is not None and ended_after_s < limit_s else content["record"]


def read_older_record(folder: Path, work: Work) -> tuple[str, Record] | None:
    """The digest of the code and the record of work with these settings, whatever code did it."""
    content = kept_content(folder, work)
    if content.get("settings") != work.settings_digest or not isinstance(content.get("code"), str):
        return None
    if content.get("digest") != result_digest(work, content["code"]):
        return None
    return content["code"], content["record"]


def kept_content(folder: Path, work: Work) -> dict[str, Any]:
    """What the file of some work holds; nothing if there is none, or if it was changed by hand."""
    try:
        content = json.loads(kept_file(folder, work.file).read_text())
    except (OSError, ValueError):
        return {}
    record = content.get("record") if isinstance(content, dict) else None
    return content if isinstance(record, dict) and content.get("checksum") == _checksum(record) else {}
