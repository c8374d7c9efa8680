"""The runs of Bhattacharya's experiments (a), (b) and (d): controls, variants, plans and sensor ranges."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baselines.experiments.outcome import Outcome, Record
from baselines.experiments.provenance import code_digest
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.runner import Conditions, run_all
from baselines.papers.bhattacharya.run import Run
from baselines.papers.bhattacharya.simulation.belief import Fusion, Sensor
from baselines.papers.bhattacharya.simulation.team import Rules

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


@dataclass(frozen=True)
class KeptRun:
    """A run as the runner of experiments takes it."""

    of: Run

    @property
    def file(self) -> str:
        """Its file in the folder of results, without suffix."""
        return self.of.id

    @property
    def settings_digest(self) -> str:
        """Of all that decides its result but the code."""
        return hashlib.sha256(repr(self.of).encode()).hexdigest()

    def code_digest(self) -> str:
        """Of the code that this process would run it with."""
        return code_digest(Run.__module__)

    def run(self) -> Outcome:
        """Carry it out."""
        return self.of.carry_out()


def kept_records(
    runs: Sequence[Run], folder: Path, workers: int | RayCluster, quiet: bool
) -> dict[str, Record]:
    """Run what is missing, under a progress bar; id → record."""
    found = run_all([KeptRun(run) for run in runs], Conditions(folder, workers, "Bhattacharya", quiet))
    return {run.id: record for run, record in zip(runs, found, strict=True)}
