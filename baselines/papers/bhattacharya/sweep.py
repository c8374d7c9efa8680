"""The runs of Bhattacharya's experiments (a), (b) and (d), kept as files: what was run is not run again."""

from __future__ import annotations

import ast
import dataclasses
import hashlib
import io
import json
import math
import multiprocessing
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

import entropy_explore_env
from baselines.papers.bhattacharya.simulation import belief as bhattacharya_belief
from baselines.papers.bhattacharya.simulation import team as bhattacharya_grid
from baselines.papers.bhattacharya.simulation.belief import Fusion, Sensor
from baselines.papers.bhattacharya.simulation.team import Rules, Simulation, Tally
from baselines.strategies.voronoi import controls as voronoi_control
from entropy_explore_env.belief.paths.geodesic_cells import new_tessellation, tessellate
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.settings import Grid
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.writing import write_atomically

Record = dict[str, Any]

SNAPSHOTS = 6
"""Moments of a run that are kept for its picture."""
_KEPT_SERIES = 400


@dataclass(frozen=True)
class Run:
    """One run.

    Attributes:
        id: Its name, also that of its files.
        world: Name of the recipe.
        shape: Cells of the plan along x and y.
        starts: `random` all over the plan; `cluster`, side by side somewhere; `corner`, in the lower left.
        seed: Of plan, starts and lost messages.
        robots: How many.
        known: Whether the plan is known.
        limit: Most iterations.
        pictured: Whether maps are kept for a picture.
        cell_m: What the recipe takes a cell for.
    """

    id: str
    world: str
    shape: tuple[int, int]
    starts: Literal["random", "cluster", "corner"]
    seed: int
    robots: int
    rules: Rules
    known: bool
    limit: int
    pictured: bool = False
    cell_m: float = field(default=0.1, repr=False)  # the plan, which is part of the digest, tells

    def digest(self) -> str:
        """Of all that decides the results."""
        settings = repr((_sources_digest(), dataclasses.replace(self, pictured=False), self.pictured))
        return hashlib.sha256(settings.encode() + self.plan().tobytes()).hexdigest()[:16]

    def plan(self) -> np.ndarray:
        """(X, Y, 1) bool, occupied."""
        grid = Grid((*self.shape, 1), self.cell_m)
        scenario = with_settings(find_scenario(self.world), {"grid": grid})
        return make_world(scenario, np.random.default_rng(self.seed)).occupied


@lru_cache(maxsize=1)
def _sources_digest() -> str:
    """Of the code that results come from, whatever its comments say."""
    ours = [
        Path(str(module.__file__)) for module in (voronoi_control, bhattacharya_belief, bhattacharya_grid)
    ]
    hasher = hashlib.sha256()
    for source in [*ours, Path(entropy_explore_env.__file__).parent / "belief/paths/geodesic_cells.py"]:
        tree = ast.parse(source.read_text())
        for node in ast.walk(tree):
            body = getattr(node, "body", None)
            if isinstance(body, list):  # no text that stands alone
                node.body = [part for part in body if not _is_text(part)]  # type: ignore[attr-defined]
        hasher.update(ast.dump(tree).encode())
    return hasher.hexdigest()


def _is_text(part: ast.AST) -> bool:
    return isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant)


CONTROLS: dict[str, dict[str, Any]] = {
    "projected": {"control": "projected-centroid", "guarded": False},
    "projected-guarded": {"control": "projected-centroid", "guarded": True},
    "gradient": {"control": "gradient-search"},
}
"""Of (a): the two of the paper, and the first with robots that move only if their own functional falls."""

VARIANTS: dict[str, dict[str, Any]] = {
    "length": {"metric": "length"},
    "nearest": {"control": "nearest"},
    "nearest-length": {"control": "nearest", "metric": "length"},
    "phases": {"perfect": False, "phase": 10},
    "phases-loss": {"perfect": False, "phase": 10, "loss": 0.5},
}
"""Of (b): one thing changed at a time, but for `nearest-length`."""
PICTURED = ("paper", "nearest-length")
"""Of (b), each in the largest plan in which it is run."""

FUSIONS: dict[str, dict[str, Any]] = {
    "far-mean": {"tau": 0.15, "tau_floor": 0.14},
    "far-best": {"tau": 0.15, "tau_floor": 0.14, "fusion": Fusion(most_confident=True)},
}
"""Of (b), on the first small plan: τ below the entropy of a far reading, with either fusion."""


@dataclass(frozen=True)
class Floor:
    """A kind of plan of (b).

    Attributes:
        shape: Cells along x and y.
        cell_m: What the recipe takes a cell for; it draws rooms of 7-18 m.
        limit: Most iterations.
        paper: In how many iterations the paper explores, covers and converges; in small plans a third.
        middle: Sensor range of the variants, in cells.
        ranges: Those of the paper's settings; the paper gives none.
        variants: What is run there besides.
        text: What it is.
    """

    shape: tuple[int, int]
    cell_m: float
    limit: int
    paper: int
    middle: float
    ranges: tuple[float, ...]
    variants: tuple[str, ...]
    text: str


FLOORS = {
    "wide": Floor((1000, 783), 0.1 / 3.0, 25_000, 2750, 100.0, (100.0,), (), "rooms 210-540 cells wide"),
    "narrow": Floor(
        (1000, 783), 0.1, 25_000, 2750, 100.0, (), ("nearest-length",), "rooms 70-180 cells wide"
    ),
    "small": Floor(
        (333, 261),
        0.1,
        4000,
        917,
        35.0,
        (17.0, 35.0, 70.0, 140.0, 433.0),
        (*VARIANTS, *FUSIONS),
        "the wide plans in cells three times as large",
    ),
}
"""The largest range looks over the whole plan. There is time to run many small plans, and few others."""


def coverage_id(control: str, starts: str, seed: int) -> str:
    """Name of a run of (a)."""
    return f"coverage-{control}-{starts}-{seed}"


def exploration_id(floor: str, variant: str, range_cells: float, seed: int) -> str:
    """Name of a run of (b); variant `paper` = nothing changed."""
    return f"exploration-{floor}-{variant}-{range_cells:g}-{seed}"


def all_runs(coverage_seeds: int, plans: int, small_plans: int) -> list[Run]:
    """The runs of (a), and of (b) in small plans and in those of the paper's size."""
    runs = [
        Run(
            coverage_id(name, starts, seed),
            "bhattacharya-office",
            (170, 200),
            starts,
            seed,
            5,
            Rules(keeps_targets=False, **changes),
            known=True,
            limit=2000,
        )
        for name, changes in CONTROLS.items()
        for starts in ("random", "cluster")
        for seed in range(coverage_seeds)
    ]
    for name, floor in FLOORS.items():
        points = [("paper", range_cells) for range_cells in floor.ranges]
        points += [(variant, floor.middle) for variant in floor.variants]
        for seed in range(small_plans if name == "small" else plans):
            runs += [
                _exploration(name, variant, range_cells, seed)
                for variant, range_cells in points
                if seed == 0 or variant not in FUSIONS
            ]
    return runs


def _exploration(floor: str, variant: str, range_cells: float, seed: int) -> Run:
    """A run of (b); of those that may be pictured, the first is, on each kind of plan."""
    plan, changes = FLOORS[floor], {"paper": {}, **VARIANTS, **FUSIONS}[variant]
    return Run(
        exploration_id(floor, variant, range_cells, seed),
        "bhattacharya-cluttered",
        plan.shape,
        "corner",
        seed,
        4,
        Rules(sensor=Sensor(range_cells), **changes),
        known=False,
        limit=plan.limit,
        pictured=seed == 0 and variant in PICTURED and range_cells == plan.middle,
        cell_m=plan.cell_m,
    )


def start_cells(occupied: np.ndarray, starts: str, robots: int, seed: int) -> list[int]:
    """Free cells for the robots; those of a cluster are 10 cells apart at least."""
    free = np.flatnonzero(~occupied.reshape(-1))
    rng = np.random.default_rng((seed, 1))
    if starts == "random":
        return rng.choice(free, robots, replace=False).tolist()
    width = occupied.shape[1]
    first = (
        int(free[np.argmin(free // width + free % width)]) if starts == "corner" else int(rng.choice(free))
    )
    space = new_tessellation(occupied.shape)
    tessellate(space, np.where(occupied, np.inf, 1.0).astype(np.float32), np.array([first]))
    costs, found = space.costs.reshape(-1), list[int]()
    for cell in np.argsort(costs, kind="stable"):
        apart = [max(abs(cell // width - f // width), abs(cell % width - f % width)) for f in found]
        if math.isfinite(costs[cell]) and min(apart, default=math.inf) >= 10:
            found.append(int(cell))
        if len(found) == robots:
            break
    return found


def carried_out(run: Run) -> tuple[Record, dict[str, np.ndarray]]:
    """Run it: its record, and maps for its picture."""
    occupied = run.plan()
    starts = start_cells(occupied, run.starts, run.robots, run.seed)
    simulation = Simulation(occupied, starts, run.rules, run.known, run.seed)
    maps: dict[str, np.ndarray] = {}
    if not run.pictured:
        return record_of(run, simulation.run(run.limit, 1 if run.known else 0)), maps
    taken: list[dict[str, np.ndarray]] = []
    for _ in range(run.limit):
        goes_on = simulation.step(False)
        taken.append(_snapshot(simulation)) if len(
            simulation.tally.places
        ) % 100 == 1 or not goes_on else None
        if not goes_on:
            simulation.tally.ended = "converged"
            break
    chosen = np.unique(np.linspace(0, len(taken) - 1, SNAPSHOTS).round().astype(int))
    for number, index in enumerate(chosen):
        maps |= {f"{name}_{number}": array for name, array in taken[index].items()}
    return record_of(run, simulation.tally), maps


def _snapshot(simulation: Simulation) -> dict[str, np.ndarray]:
    """Robot 0's map and cells, in bytes."""
    mind = simulation.minds[0]
    return {
        "entropy": np.round(255.0 * mind.belief.entropy[:, :, 0] / math.log(2.0)).astype(np.uint8),
        "occupied": mind.belief.occupied[:, :, 0],
        "cells": mind.space.cells[:, :, 0].astype(np.int8),
        "places": simulation.places.copy(),
        "iteration": np.array(len(simulation.tally.places)),
    }


def record_of(run: Run, tally: Tally) -> Record:
    """What reports need."""
    functional = np.array(tally.functional)
    falls = -np.diff(functional) / functional[:-1] if np.isfinite(functional).all() else np.zeros(0)
    busy = np.array(tally.tessellations) > 0
    rows = np.unique(np.linspace(0, len(tally.places) - 1, _KEPT_SERIES).round().astype(int))
    seconds = np.array(tally.seconds)[1:]
    return {
        "iterations": len(tally.places),
        "ended": tally.ended,
        "cycle": tally.cycle,
        "explored_at": tally.explored_at,
        "uncertain_left": tally.uncertain[-1],
        "seconds_an_iteration": float(seconds.mean()) if len(seconds) else 0.0,
        "seconds_with_tessellation": float(np.median(seconds[busy[1:]])) if busy[1:].any() else 0.0,
        "tessellations": int(sum(tally.tessellations)),
        "rises": int((falls < -1e-12).sum()),
        "largest_rise": float(max((-falls).max(initial=0.0), 0.0)),
        "functional_first": _number(functional[0]),
        "functional_last": _number(functional[-1]),
        "bits": tally.bits[-1],
        "places": tally.places,
        "series": {
            "iteration": rows.tolist(),
            "uncertain": np.array(tally.uncertain)[rows].tolist(),
            "entropy": np.round(np.array(tally.entropy)[rows], 1).tolist(),
            "functional": [_number(value) for value in functional[rows]],
            "bits": np.array(tally.bits)[rows].tolist(),
        },
        "rules": dataclasses.asdict(run.rules),
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def run_all(runs: Sequence[Run], folder: Path, jobs: int, quiet: bool) -> dict[str, Record]:
    """Run what is missing, under a progress bar; id → record."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    folder.mkdir(parents=True, exist_ok=True)
    records = {run.id: record for run in runs if (record := read_record(folder, run)) is not None}
    todo = [run for run in runs if run.id not in records]
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(file=sys.stderr), disable=quiet) as progress:
        task = progress.add_task("Bhattacharya", total=len(runs), completed=len(records))
        if todo and jobs == 1:
            for run in todo:
                records[run.id] = kept(run, folder)
                progress.advance(task)
        elif todo:
            context = multiprocessing.get_context("spawn")
            with ProcessPoolExecutor(min(jobs, len(todo)), mp_context=context) as pool:
                waiting = {pool.submit(kept, run, folder): run for run in todo}
                for future in as_completed(waiting):
                    records[waiting[future].id] = future.result()
                    progress.advance(task)
    return records


def kept(run: Run, folder: Path) -> Record:
    """Carry a run out and write its files."""
    record, maps = carried_out(run)
    if maps:
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, **maps)
        write_atomically(folder / f"{run.id}.npz", buffer.getvalue())
    content = json.dumps({"digest": run.digest(), "record": record}, allow_nan=False)
    write_atomically(folder / f"{run.id}.json", content)
    return record


def read_record(folder: Path, run: Run) -> Record | None:
    """The record of a run that was carried out with this code."""
    try:
        content = json.loads((folder / f"{run.id}.json").read_text())
    except (OSError, ValueError):
        return None
    ours = isinstance(content, dict) and content.get("digest") == run.digest()
    return content["record"] if ours else None
