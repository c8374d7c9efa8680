"""Experiments: many missions in cells, run in processes, resumable; claims with intervals.

A cell is a scenario with a strategy; its missions differ by seed. Every mission leaves one small
file, written whole or not at all, so that an experiment goes on where it was stopped.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import entropy_explore_env
from baselines.mission import run_mission, scripted
from baselines.strategies import make_strategy
from baselines.strategy import Strategy
from entropy_explore_env.config import Scenario
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.writing import write_atomically

_SERIES_POINTS = 200
_MISSIONS_A_TASK = 5
_RESAMPLES = 9999
_CONFIDENCE = 0.95

Record = dict[str, Any]


@lru_cache(maxsize=1)
def _sources_digest() -> str:
    """Of the code that missions come from: records of other code are not taken for ours."""
    hasher = hashlib.sha256()
    library = Path(entropy_explore_env.__file__).parent
    for source in [*sorted(library.rglob("*.py")), *sorted(Path(__file__).parent.glob("*.py"))]:
        hasher.update(source.read_bytes())
    return hasher.hexdigest()


@dataclass(frozen=True)
class Cell:
    """One point of an experiment.

    Attributes:
        id: Its name, also that of its folder.
        scenario: The task.
        strategy: Name of the strategy.
        seeds: Number of missions; their seeds are 0, 1, …, the same in every cell (paired).
        record: Runs a mission with a strategy and a seed, and says what is kept; None = `mission_record`.
    """

    id: str
    scenario: Scenario
    strategy: str
    seeds: int
    record: Callable[[EntropyExploreEnv, str, int], Record] | None = None

    @cached_property
    def digest(self) -> str:
        """Of all that decides the results; worked out once, since it reads sources and world files."""
        world = Path(self.scenario.world)
        content = hashlib.sha256(world.read_bytes()).hexdigest() if world.is_file() else ""
        described = repr((_sources_digest(), content, scripted(self.scenario), self.strategy))
        if self.record is not None:
            made_by = sys.modules[self.record.__module__].__file__ or ""
            described += repr(self.record) + hashlib.sha256(Path(made_by).read_bytes()).hexdigest()
        return hashlib.sha256(described.encode()).hexdigest()[:16]


def run_cells(
    cells: Sequence[Cell], folder: Path, jobs: int, title: str, quiet: bool
) -> dict[str, list[Record]]:
    """Run what is missing of an experiment, under a progress bar.

    Args:
        cells: The points.
        folder: For one file a mission.
        jobs: Processes.
        title: Of the progress bar.
        quiet: Show no bar.

    Returns:
        Cell id → records by seed. A record holds the figures of `mission_figures`, and
        `series`, `sent_by_scan` and `half_s` (see `mission_record`).
    """
    records: dict[str, dict[int, Record]] = {cell.id: {} for cell in cells}
    todo: list[tuple[Cell, list[int]]] = []
    for cell in cells:
        missing = []
        for seed in range(cell.seeds):
            record = _read(folder, cell, seed)
            if record is None:
                missing.append(seed)
            else:
                records[cell.id][seed] = record
        todo += [(cell, missing[i : i + _MISSIONS_A_TASK]) for i in range(0, len(missing), _MISSIONS_A_TASK)]
    done = sum(len(found) for found in records.values())
    for cell, seed, record in _progressing(_run_tasks(todo, folder, jobs), cells, done, title, quiet):
        records[cell.id][seed] = record
    return {cell.id: [records[cell.id][seed] for seed in range(cell.seeds)] for cell in cells}


def _progressing(
    results: Iterator[tuple[Cell, int, Record]], cells: Sequence[Cell], done: int, title: str, quiet: bool
) -> Iterator[tuple[Cell, int, Record]]:
    """Pass results on under a progress bar on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(file=sys.stderr), disable=quiet) as progress:
        task = progress.add_task(title, total=sum(cell.seeds for cell in cells), completed=done)
        for result in results:
            progress.advance(task)
            yield result


def _run_tasks(
    todo: Sequence[tuple[Cell, list[int]]], folder: Path, jobs: int
) -> Iterator[tuple[Cell, int, Record]]:
    """Run tasks in processes and yield their records as they come."""
    if not todo:
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(todo)), mp_context=context) as pool:
        waiting: dict[Future[list[Record]], tuple[Cell, list[int]]] = {
            pool.submit(_run_task, cell, seeds, folder): (cell, seeds) for cell, seeds in todo
        }
        try:
            while waiting:
                finished, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in finished:
                    cell, seeds = waiting.pop(future)
                    yield from (
                        (cell, seed, record) for seed, record in zip(seeds, future.result(), strict=True)
                    )
        finally:
            for future in waiting:
                future.cancel()


def _run_task(cell: Cell, seeds: Sequence[int], folder: Path) -> list[Record]:
    """Run missions of one cell in this process; each leaves its file."""
    env = EntropyExploreEnv(scripted(cell.scenario))
    records = []
    for seed in seeds:
        record = (cell.record or mission_record)(env, cell.strategy, seed)
        content = json.dumps({"digest": cell.digest, "record": record}, allow_nan=False)
        write_atomically(_path(folder, cell, seed), content)
        records.append(record)
    return records


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


def _path(folder: Path, cell: Cell, seed: int) -> Path:
    return folder / cell.id / f"seed-{seed}.json"


def _read(folder: Path, cell: Cell, seed: int) -> Record | None:
    """A mission's record if it was run with the same settings before."""
    try:
        content = json.loads(_path(folder, cell, seed).read_text())
    except (OSError, ValueError):
        return None
    ours = isinstance(content, dict) and content.get("digest") == cell.digest
    return content.get("record") if ours else None


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
    rows = zip(*columns.values(), strict=True)
    return "\n".join(",".join(str(cell) for cell in row) for row in [tuple(columns), *rows]) + "\n"
