"""Experiments: many missions in cells, run in processes, resumable; claims with intervals.

A cell is a scenario with a strategy; its missions differ by seed. Every mission leaves one small
file, written whole or not at all, so that an experiment goes on where it was stopped.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from baselines.experiments import mission
from baselines.experiments.mission import run_mission, scripted
from baselines.experiments.provenance import sources_digest
from baselines.experiments.worker_pool import Failure, run_each
from baselines.strategies import make_strategy
from baselines.strategies.protocol import Strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.writing import write_atomically

_SERIES_POINTS = 200
_PACE_PERIOD_S = 600.0
"""The bar's time left is reckoned from so much of the past: single missions differ a lot."""
_LONGEST_REASON = 200
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
"""Where an object lies: another place in every process."""
_RESAMPLES = 9999
_CONFIDENCE = 0.95

Record = dict[str, Any]
Item = TypeVar("Item")


def mission_record(env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
    """Run a mission and keep what reports need of it.

    Returns:
        The mission's figures; `half_s`, when the best map had lost half of H(0) - H_th;
        `sent_by_scan`, measurements sent after each of the team's scans; and `series`: time,
        entropy of the best map and measurements sent so far at up to 200 moments.
    """
    return record_mission(env, make_strategy(strategy), seed)


def record_mission(
    env: EntropyExploreEnv,
    strategy: Strategy,
    seed: int,
    after_step: Callable[[EntropyExploreEnv], None] | None = None,
) -> Record:
    """`mission_record` of a strategy that is there; `after_step` is called after the reset and every step."""
    recorder = Recorder(env.missions)

    def note(env: EntropyExploreEnv) -> None:
        recorder.note()
        if after_step is not None:
            after_step(env)

    run_mission(env, strategy, seed, note)
    figures = mission_figures(env.missions, 0)
    best = recorder.entropy_bits.min(axis=1)
    middle = 0.5 * (figures["entropy_start_bits"] + figures["entropy_threshold_bits"])
    halved = np.flatnonzero(best <= middle)
    rows = recorder.spread(_SERIES_POINTS)
    single = np.flatnonzero(np.diff(recorder.scans) == 1)
    scanned = np.diff(recorder.robot_scans, axis=0)[single].argmax(axis=1)
    places = recorder.places_m[1:]
    apart_m = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1).sum() / max(
        len(places) * places.shape[1] * (places.shape[1] - 1), 1
    )
    return {
        **figures,
        "half_s": float(recorder.time_s[halved[0]]) if len(halved) else None,
        "sent_by_scan": np.diff(recorder.shared)[single].tolist(),
        "depth_by_scan_m": np.round(recorder.depths_m[1:][single, scanned], 3).tolist(),
        "apart_m": round(float(apart_m), 3),
        "series": {
            "time_s": np.round(recorder.time_s[rows], 3).tolist(),
            "entropy_bits": np.round(best[rows], 1).tolist(),
            "shared_measurements": recorder.shared[rows].tolist(),
        },
    }


@dataclass(frozen=True)
class Cell:
    """One point of an experiment.

    Attributes:
        id: Its name, also that of its folder; slashes make folders in folders.
        scenario: The task.
        strategy: Name of the strategy.
        seeds: Number of missions; their seeds are 0, 1, …, the same in every cell (paired).
        record: Runs a mission with a strategy and a seed, and says what is kept of it.
    """

    id: str
    scenario: Scenario
    strategy: str
    seeds: int
    record: Callable[[EntropyExploreEnv, str, int], Record] = mission_record

    @cached_property
    def digest(self) -> str:
        """Of all that decides the results; worked out once, since it reads sources and world files."""
        parts = _parts(self.record)
        made_by = {type(part).__module__ for part in parts if is_dataclass(part)} | {self.record.__module__}
        described = repr(
            (
                sources_digest(self.strategy, mission.__name__, *sorted(made_by)),
                scripted(self.scenario),
                self.strategy,
                self.record if is_dataclass(self.record) else None,  # it has settings of its own
            )
        )
        for file in (self.scenario.world, *(part for part in parts if isinstance(part, str))):
            if Path(file).is_file():
                described += hashlib.sha256(Path(file).read_bytes()).hexdigest()
        return hashlib.sha256(described.encode()).hexdigest()[:16]


def _parts(record: object) -> list[object]:
    """A value, and where it is a dataclass the values of its fields, and of theirs."""
    fields = vars(record).values() if is_dataclass(record) else ()
    return [record, *(part for value in fields for part in _parts(value))]


def run_cells(
    cells: Sequence[Cell],
    folder: Path,
    jobs: int,
    title: str,
    quiet: bool,
    limit_s: float = math.inf,
    keep_failures: bool = False,
) -> dict[str, list[Record]]:
    """Run what is missing of an experiment, under a progress bar.

    Args:
        cells: The points.
        folder: For one file a mission.
        jobs: Processes; with one, missions run in this process.
        title: Of the progress bar.
        quiet: Show no bar.
        limit_s: Of every mission, on the clock; see `workers.run_each`.
        keep_failures: A mission that fails leaves the record of `failed_record`; else its error is raised.

    Returns:
        Cell id → records by seed; see `mission_record` for what one holds.
    """
    records: dict[str, dict[int, Record]] = {cell.id: {} for cell in cells}
    todo: list[tuple[Cell, int]] = []
    # all cells grow together: so the bar's time left means something from the first round on
    for seed in range(max((cell.seeds for cell in cells), default=0)):
        for cell in cells:
            record = _read(folder, cell, seed, limit_s) if seed < cell.seeds else None
            if record is not None:
                records[cell.id][seed] = record
            elif seed < cell.seeds:
                todo.append((cell, seed))
    done = sum(len(found) for found in records.values())
    results = run_each(_run_one, todo, jobs, limit_s)
    for (cell, seed), outcome in _progressing(results, done, done + len(todo), title, quiet):
        if isinstance(outcome, Failure):
            if not keep_failures:
                outcome.throw()
            record = failed_record(outcome, limit_s)
        else:
            record = outcome
        _write(folder, cell, seed, record)
        records[cell.id][seed] = record
    return {cell.id: [records[cell.id][seed] for seed in range(cell.seeds)] for cell in cells}


def _progressing(results: Iterator[Item], done: int, total: int, title: str, quiet: bool) -> Iterator[Item]:
    """Pass results on under a progress bar on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(file=sys.stderr)
    with Progress(*columns, console=console, disable=quiet, speed_estimate_period=_PACE_PERIOD_S) as progress:
        task = progress.add_task(title, total=total, completed=done)
        for result in results:
            progress.advance(task)
            yield result


def _run_one(task: tuple[Cell, int]) -> Record:
    """Run a mission of a cell in this process."""
    cell, seed = task
    try:
        return cell.record(_environment(scripted(cell.scenario)), cell.strategy, seed)
    except BaseException:
        _environment.cache_clear()  # it stopped in the middle of something
        raise


@lru_cache(maxsize=1)
def _environment(scenario: Scenario) -> EntropyExploreEnv:
    """Kept for the next mission."""
    return EntropyExploreEnv(scenario)


def failed_record(failure: Failure, limit_s: float) -> Record:
    """What is kept of a mission that failed.

    Returns:
        `failed`, the reason; `trace`, where it was; and `limit_s` of a mission that ran past it, which a
        longer limit runs again.
    """
    reason = _ADDRESS.sub(" at 0x…", failure.reason)
    reason = reason if len(reason) <= _LONGEST_REASON else reason[:_LONGEST_REASON] + " …"
    return {"failed": reason, "trace": failure.trace, "limit_s": limit_s if failure.late else None}


def _path(folder: Path, cell: Cell, seed: int) -> Path:
    return folder / cell.id / f"seed-{seed}.json"


def _write(folder: Path, cell: Cell, seed: int, record: Record) -> None:
    content = {"digest": cell.digest, "checksum": _checksum(record), "record": record}
    write_atomically(_path(folder, cell, seed), json.dumps(content, allow_nan=False))


def _checksum(record: object) -> str:
    """Of a record, so that one that was changed by hand is run again."""
    return hashlib.sha256(json.dumps(record).encode()).hexdigest()[:16]


def _read(folder: Path, cell: Cell, seed: int, limit_s: float = math.inf) -> Record | None:
    """A mission's record if it was run with the same settings before, and not ended by a shorter limit."""
    try:
        content = json.loads(_path(folder, cell, seed).read_text())
    except (OSError, ValueError):
        return None
    if not isinstance(content, dict) or content.get("digest") != cell.digest:
        return None
    record = content.get("record")
    if not isinstance(record, dict) or content.get("checksum") != _checksum(record):
        return None
    ended_after_s = record.get("limit_s")
    return None if ended_after_s is not None and ended_after_s < limit_s else record


@dataclass(frozen=True)
class Claim:
    """A claim of a paper beside what was measured.

    Attributes:
        id: Stable name.
        claim: What is claimed.
        paper: The paper's figure, if it gives one.
        ours: Ours.
        low: Lower end of a 95 % interval of ours, if it has one.
        high: Upper end.
        holds: Whether the claim holds.
    """

    id: str
    claim: str
    paper: float | str | None
    ours: float | str | None
    low: float | None
    high: float | None
    holds: bool

    def row(self) -> dict[str, Any]:
        """As JSON has it."""
        return asdict(self)


def mean_interval(values: Sequence[float] | np.ndarray) -> tuple[float, float, float]:
    """Mean and its 95 % interval by bootstrap over missions (percentiles)."""
    sample = np.asarray(values, float)
    means = _resampled(sample, len(sample)).mean(axis=1)
    return (float(sample.mean()), *_central(means))


def median_interval(values: Sequence[float] | np.ndarray) -> tuple[float, float, float]:
    """Median and its 95 % interval by bootstrap over missions (percentiles)."""
    sample = np.asarray(values, float)
    medians = np.median(_resampled(sample, len(sample)), axis=1)
    return (float(np.median(sample)), *_central(medians))


def small_mean_range(values: Sequence[float] | np.ndarray, starts: int) -> tuple[float, float]:
    """Where 95 % of the means of only `starts` missions lie."""
    return _central(_resampled(np.asarray(values, float), starts).mean(axis=1))


def ratio_interval(
    upper: Sequence[float] | np.ndarray, lower: Sequence[float] | np.ndarray
) -> tuple[float, float, float]:
    """Ratio of two means over the same seeds, and its 95 % interval (paired bootstrap)."""
    pairs = np.stack([np.asarray(upper, float), np.asarray(lower, float)], axis=1)
    means = _resampled(pairs, len(pairs)).mean(axis=1)
    return (float(pairs[:, 0].mean() / pairs[:, 1].mean()), *_central(means[:, 0] / means[:, 1]))


def double_ratio_interval(
    upper: np.ndarray, lower: np.ndarray, upper_before: np.ndarray, lower_before: np.ndarray
) -> tuple[float, float, float]:
    """A ratio of two means over the same ratio before, all over the same seeds, and its 95 % interval."""
    rows = np.stack([upper, lower, upper_before, lower_before], axis=1)
    means = np.concatenate([rows.mean(axis=0)[None], _resampled(rows, len(rows)).mean(axis=1)])
    ratios = means[:, 0] / means[:, 1] / (means[:, 2] / means[:, 3])
    return (float(ratios[0]), *_central(ratios[1:]))


def median_ratio_interval(
    upper: Sequence[float] | np.ndarray, lower: Sequence[float] | np.ndarray
) -> tuple[float, float, float]:
    """Ratio of two medians over the same seeds, and its 95 % interval (paired bootstrap)."""
    pairs = np.stack([np.asarray(upper, float), np.asarray(lower, float)], axis=1)
    medians = np.median(_resampled(pairs, len(pairs)), axis=1)
    return (
        float(np.median(pairs[:, 0]) / np.median(pairs[:, 1])),
        *_central(medians[:, 0] / medians[:, 1]),
    )


def _resampled(sample: np.ndarray, size: int) -> np.ndarray:
    """(resamples, size, …) draws with replacement, always the same ones."""
    rows = np.random.default_rng(0).integers(len(sample), size=(_RESAMPLES, size))
    return sample[rows]


def _central(values: np.ndarray) -> tuple[float, float]:
    low, high = np.quantile(values, [(1 - _CONFIDENCE) / 2, (1 + _CONFIDENCE) / 2])
    return float(low), float(high)


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines) + "\n"


def csv_table(columns: Mapping[str, Sequence[object]]) -> str:
    """Columns of equal length as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([tuple(columns), *zip(*columns.values(), strict=True)])
    return text.getvalue()
