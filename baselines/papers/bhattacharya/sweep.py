"""Bhattacharya's experiments as trials: controls, variants, plans and sensor ranges, and missions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from baselines.experiments.experiment import Amount
from baselines.experiments.rows import Record
from baselines.experiments.trials import Trial, trials_of
from baselines.papers.bhattacharya.missions import mission_cells
from baselines.papers.bhattacharya.run import Run, start_cells
from baselines.papers.bhattacharya.simulation.belief import Sensor
from baselines.papers.bhattacharya.simulation.team import Rules, Simulation
from baselines.papers.bhattacharya.splitting import ratios
from baselines.papers.bhattacharya.timing import beside_scipy, changed_share
from entropy_explore_env.errors import SettingError

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
        tuple(VARIANTS),
        "the wide plans in cells three times as large",
    ),
}
"""The largest range looks over the whole plan. There is time to run many small plans, and few others."""


def coverage_id(control: str, starts: str) -> str:
    """Return the name of runs of (a)."""
    return f"coverage-{control}-{starts}"


def exploration_id(floor: str, variant: str, range_cells: float) -> str:
    """Return the name of runs of (b); variant `paper` = nothing changed."""
    return f"exploration-{floor}-{variant}-{range_cells:g}"


def experiment(amount: Amount) -> list[Trial]:
    """Return all trials.

    Of n seeds there are n runs of (a) for each control and kind of start, half as many small plans of (b)
    and one of each other kind, a quarter of (e) and as many as seeds of (f), times missions of each. A quick
    run has a fifth of small plans, and no others and no (e).
    """
    if len(amount.worlds) > 1:
        raise SettingError("worlds", " ".join(map(str, amount.worlds)), "an OctoMap of one corridor")
    small = max(1, amount.seeds // (5 if amount.quick else 2))
    runs = all_runs(amount.seeds, 0 if amount.quick else 1, small)
    cells = mission_cells(max(1, amount.seeds // 4), amount.worlds[0] if amount.worlds else None)
    missions = [cell for cell in cells if not (amount.quick and cell.id.startswith("flying"))]
    return [*runs, Measured(max((run for run in runs if not run.known), key=size_of)), *trials_of(missions)]


def all_runs(coverage_seeds: int, plans: int, small_plans: int) -> list[Run]:
    """Return the runs of (a), and of (b) in small plans and in those of the paper's size."""
    runs = [
        Run(
            coverage_id(name, starts),
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
        seeds = range(small_plans if name == "small" else plans)
        runs += [_exploration(name, *point, seed) for seed, point in product(seeds, points)]
    return runs


def size_of(run: Run) -> int:
    """Return how many cells the plan of a run has."""
    return run.shape[0] * run.shape[1]


def _exploration(floor: str, variant: str, range_cells: float, seed: int) -> Run:
    """Return a run of (b); of those that may be pictured, the first is, on each kind of plan."""
    plan, changes = FLOORS[floor], {"paper": {}, **VARIANTS}[variant]
    return Run(
        exploration_id(floor, variant, range_cells),
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
class Measured:
    """What is measured beside the runs: (c), and a tessellation of the largest plan on the clock.

    Attributes:
        largest: A run in that plan.
    """

    largest: Run
    cell: str = "measured"
    seed: int = 0
    world: str = "bhattacharya-cluttered"

    @property
    def settings(self) -> dict[str, Any]:
        """The run."""
        return {"largest": self.largest.settings}

    def run(self) -> Record:
        """Measure.

        Returns:
            `splits`, ratios of (c) by region; `ours_s` and `scipy_s` of a tessellation; `changed`, the share
            of a small plan's cells whose cost or owner changes from one tessellation to the next.
        """
        plan = self.largest.plan()
        costs = np.where(plan, np.inf, 1.0).astype(np.float32)
        seconds = beside_scipy(costs, np.array(start_cells(plan, "random", 4, 0)))
        run = replace(_exploration("small", "paper", FLOORS["small"].ranges[0], 0), pictured=False)
        simulation = Simulation(run.plan(), start_cells(run.plan(), run.starts, run.robots, 0), run.rules)
        changed = changed_share(simulation, 200)
        return {"splits": ratios(), "ours_s": seconds.ours, "scipy_s": seconds.scipy, "changed": changed}
