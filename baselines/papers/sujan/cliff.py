"""Sujan's cliff: a rover maps it from the plateau above by the paper's five methods (figs. 24-32)."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from baselines.experiments.claims import Claim, above, below
from baselines.experiments.experiment import Amount, Experiment, Records, sample
from baselines.experiments.mission import Surroundings
from baselines.experiments.statistics import Interval, mean_interval, ratio_interval
from baselines.experiments.tables import cells_table
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.papers.sujan import cliff_figures
from baselines.papers.sujan.cliff_figures import edge_corners, samples_table
from baselines.papers.sujan.cliff_mission import (
    FEW,
    METHODS,
    MORE,
    STEPS,
    cell_id,
    interest_in,
    looks_of,
    new_columns,
    record_mapping,
    scenario_of,
    start_of,
    steps_needed,
)
from entropy_explore_env.errors import counted

_PAPER_RATIO, _PAPER_SHARE = 10.0, 0.5
GROUPS = {
    "ten-": "method 5 maps about ten times what method 1 maps, after 10, 20, 40 steps; ratio",
    "more-": "in 10 steps 3 maps more than 1 and 2, 4 more than 3, 5 more than 4 and 3; ratio",
    "half": "method 5 needs about half the steps of method 3 for what that maps in 20; share",
    "answered": "of what its looks should show, method 5 obtains more than method 3; ratio",
    "interest-": "after 10 and 40 steps interest is less in unreadable than in readable ground; ratio",
    "edge": "drives that the edge ended",
}
"""Beginning of ids → what the claims are, on the page."""


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions, one a world."""
    scenario = scenario_of(STEPS)
    where = Surroundings(every_reset=json.dumps({"starts": [start_of(scenario)]}))
    cells = [
        Cell(cell_id(method), scenario, strategy, amount.seeds, record_mapping, where)
        for method, strategy in METHODS.items()
    ]
    return trials_of(cells)


def all_claims(records: Records) -> list[Claim]:
    """Return every claim."""

    def more(better: int, worse: int, steps: int) -> Interval:
        return ratio_interval(*(new_columns(records, method)[:, steps] for method in (better, worse)))

    tens = {steps: more(5, 1, steps) for steps in (FEW, MORE, STEPS)}
    share = mean_interval(steps_needed(records))
    stops = sum(record["edge_stops"] for method in METHODS for record in records[cell_id(method)])
    interest = {
        steps: ratio_interval(*(interest_in(records, part, steps) for part in ("unreadable", "readable")))
        for steps in (FEW, STEPS)
    }
    return [
        *(Claim(f"ten-{n}", _PAPER_RATIO, *found, found.high >= _PAPER_RATIO) for n, found in tens.items()),
        *(above(f"more-{a}-{b}", more(a, b, FEW)) for a, b in ((3, 1), (3, 2), (4, 3), (5, 4), (5, 3))),
        Claim("half", _PAPER_SHARE, *share, share.low <= _PAPER_SHARE),
        above("answered", ratio_interval(*(answered(records, method, MORE) for method in (5, 3)))),
        *(below(f"interest-{steps}", found) for steps, found in interest.items()),
        Claim("edge", 0, stops, None, None, stops == 0),
    ]


def answered(records: Records, method: int, steps: int) -> np.ndarray:
    """Return (N,) new columns that the looks of some steps showed, over those that they were to show."""
    looks = [looks_of(records, method, field, steps).sum(axis=1) for field in ("obtained", "expected")]
    return np.asarray(looks[0] / np.maximum(looks[1], 1.0))


def _columns_after(records: Records, steps: int) -> Callable[[str], str]:
    """Return what shows the new columns of a cell's method after some steps."""
    return lambda cell: f"{mean_interval(new_columns(records, int(cell[-1]))[:, steps]):,.0f}"


def _methods_table(records: Records) -> str:
    """Return a table of the methods."""
    columns = {f"new columns after {n} steps": _columns_after(records, n) for n in (FEW, MORE, STEPS)}
    columns["way (m)"] = lambda cell: f"{sample(records, cell, 'distance_m').mean():.1f}"
    return cells_table(
        ["method", "strategy"], [(each, cell_id(each[0])) for each in METHODS.items()], columns
    )


def _field_table(records: Records) -> str:
    """Return figs. 29, 31 and 32 in numbers: methods 3 and 5 over the first steps."""
    steps = sorted({1, 2, FEW // 2, FEW})
    columns = {f"fig. 29: new columns after {counted(n, 'step')}": _columns_after(records, n) for n in steps}

    def left(cell: str) -> str:
        parts = [interest_in(records, part, FEW).mean() for part in ("unreadable", "readable")]
        return "{:.2f}, {:.2f}".format(*parts) if cell == cell_id(5) else "–"

    columns[f"fig. 31: obtained of expected in {FEW} looks"] = lambda cell: (
        f"{mean_interval(answered(records, int(cell[-1]), FEW)):.2f}"
    )
    columns[f"fig. 32: interest left after {FEW} steps, unreadable and readable ground"] = left
    return cells_table(["method"], [((method,), cell_id(method)) for method in (3, 5)], columns)


EXPERIMENT = Experiment(
    name="sujan-cliff",
    title="Sujan, the cliff",
    template=Path(__file__).with_name("cliff.md.j2"),
    trials=experiment,
    claims=all_claims,
    groups=GROUPS,
    figures=cliff_figures.FIGURES,
    tables={"methods": _methods_table, "field": _field_table, "samples": samples_table},
    values={"corners": edge_corners},
    quick_seeds=4,
)
