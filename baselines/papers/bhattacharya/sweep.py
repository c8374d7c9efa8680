"""Bhattacharya's experiments as trials: controls, variants, plans and sensor ranges, and channels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

from baselines.experiments.experiment import Amount
from baselines.experiments.trials import Cell, Trial, trials_of
from baselines.papers.bhattacharya.measured import Measured
from baselines.papers.bhattacharya.run import Run
from baselines.papers.bhattacharya.simulation.team import Rules
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import find_scenario

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


CHANNELS: dict[str, dict[str, Any]] = {
    "utility-64": {"burst": 64},
    "phases-64-once": {"burst": 64, "phase_s": 10.0},
    "phases-32-twice": {"burst": 32, "phase_s": 10.0, "repeats": 2},
    "phases-16-four-times": {"burst": 16, "phase_s": 10.0, "repeats": 4},
    "utility-all": {"burst": 180},
    "phases-all-once": {"burst": 180, "phase_s": 10.0},
}
"""Channel settings; I_min = 0, so that the first four send 64 measurements a scan each, the others 180."""
LOSSES = (0.0, 0.5)
RIVALS = {
    "phases-64-once": "utility-64",
    "phases-32-twice": "utility-64",
    "phases-16-four-times": "utility-64",
    "phases-all-once": "utility-all",
}
"""Which settings send as many measurements a scan at once."""


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
    """

    shape: tuple[int, int]
    cell_m: float
    limit: int
    paper: int
    middle: float
    ranges: tuple[float, ...]
    variants: tuple[str, ...]

    @property
    def points(self) -> list[tuple[str, float]]:
        """(variant, sensor range) of the runs there."""
        paper = [("paper", range_cells) for range_cells in self.ranges]
        return paper + [(variant, self.middle) for variant in self.variants]


FLOORS = {
    "wide": Floor((1000, 783), 0.1 / 3.0, 25_000, 2750, 100.0, (100.0,), ()),
    "narrow": Floor((1000, 783), 0.1, 25_000, 2750, 100.0, (), ("nearest-length",)),
    "small": Floor((333, 261), 0.1, 4000, 917, 35.0, (17.0, 35.0, 70.0, 140.0, 433.0), tuple(VARIANTS)),
}
"""Rooms of wide plans are 210-540 cells wide, of narrow ones 70-180; small plans are the wide ones in cells
three times as large. The largest range looks over the whole plan. There is time to run many small plans, and
few others."""


def coverage_id(control: str, starts: str) -> str:
    """Return the name of runs of (a)."""
    return f"coverage-{control}-{starts}"


def exploration_id(floor: str, variant: str, range_cells: float) -> str:
    """Return the name of runs of (b); variant `paper` = nothing changed."""
    return f"exploration-{floor}-{variant}-{range_cells:g}"


def channel_id(channel: str, loss: float) -> str:
    """Return the name of a cell of (f)."""
    return f"channel-{channel}-loss-{loss:g}"


def channel_cells(seeds: int) -> list[Cell]:
    """Return the cells of (f), with this many missions each."""
    cells = []
    office = find_scenario("office")
    for name, channel in CHANNELS.items():
        for loss in LOSSES:
            settings = {**channel, "i_min_bits": 0.0, "loss_probability": loss}
            scenario = with_settings(office, {"channel": settings, "time_limit_s": 1200.0})
            cells.append(Cell(channel_id(name, loss), scenario, "voronoi-nearest", seeds))
    return cells


def experiment(amount: Amount) -> list[Trial]:
    """Return all trials.

    Of n seeds there are n runs of (a) for each control and kind of start, half as many small plans of (b)
    and one of each other kind, and about n missions of (f) for each channel. A quick run has a fifth of small
    plans, and no others.
    """
    small = max(1, amount.seeds // (5 if amount.quick else 2))
    runs = all_runs(amount.seeds, 0 if amount.quick else 1, small)
    missions = trials_of(channel_cells(4 * max(1, amount.seeds // 4)))
    largest = max((run for run in runs if not run.known), key=lambda run: math.prod(run.shape))
    return [*runs, Measured(largest), *missions]


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
        seeds = range(small_plans if name == "small" else plans)
        runs += [_exploration(name, *point, seed) for seed, point in product(seeds, floor.points)]
    return runs


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
        Rules(range_cells=range_cells, **changes),
        known=False,
        limit=plan.limit,
        pictured=seed == 0 and variant in PICTURED and range_cells == plan.middle,
        cell_m=plan.cell_m,
    )
