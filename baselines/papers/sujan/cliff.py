"""Sujan's cliff: a rover maps it from the plateau above by the paper's five methods (figs. 24-32)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from baselines.experiments.claims import Claim, above, below
from baselines.experiments.experiment import Amount, Experiment, Records
from baselines.experiments.mission import Surroundings
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.experiments.tables import markdown_table
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
    return [*_ratio_claims(records), *_order_claims(records), _step_claim(records), *_look_claims(records)]


def _ratio_claims(records: Records) -> list[Claim]:
    claims = []
    for steps in (FEW, MORE, STEPS):
        ratio = ratio_interval(*(new_columns(records, method)[:, steps] for method in (5, 1)))
        text = f"method 5 maps about ten times what method 1 maps, after {steps} steps; ratio"
        claims.append(Claim(f"ten-{steps}", text, _PAPER_RATIO, *ratio, ratio.high >= _PAPER_RATIO))
    return claims


def _order_claims(records: Records) -> list[Claim]:
    claims = []
    for better, worse in ((3, 1), (3, 2), (4, 3), (5, 4), (5, 3)):
        ratio = ratio_interval(*(new_columns(records, method)[:, FEW] for method in (better, worse)))
        text = f"method {better} maps more than method {worse} ({METHODS[worse]}) in {FEW} steps; ratio"
        claims.append(above(f"more-{better}-{worse}", text, ratio))
    return claims


def _step_claim(records: Records) -> Claim:
    share = mean_interval(steps_needed(records))
    text = f"method 5 needs about half the steps that method 3 needs for what it maps in {MORE}; share"
    return Claim("half", text, _PAPER_SHARE, *share, share.low <= _PAPER_SHARE)


def _look_claims(records: Records) -> list[Claim]:
    ratio = ratio_interval(*(answered(records, method, MORE) for method in (5, 3)))
    text = f"of what its looks should show, method 5 obtains more than method 3, in {MORE} steps; ratio"
    claims = [above("answered", text, ratio)]
    for steps in (FEW, STEPS):
        ratio = ratio_interval(*(interest_in(records, part, steps) for part in ("unreadable", "readable")))
        text = (
            f"after {steps} steps of method 5 interest is less in unreadable than in readable ground; ratio"
        )
        claims.append(below(f"interest-{steps}", text, ratio))
    stops = sum(record["edge_stops"] for method in METHODS for record in records[cell_id(method)])
    return [
        *claims,
        Claim("edge", "drives that the edge ended, of all methods", 0, stops, None, None, stops == 0),
    ]


def answered(records: Records, method: int, steps: int) -> np.ndarray:
    """(N,) new columns that the looks of some steps showed, over those that they were expected to show."""
    looks = [looks_of(records, method, field, steps).sum(axis=1) for field in ("obtained", "expected")]
    return np.asarray(looks[0] / np.maximum(looks[1], 1.0))


def _methods_table(records: Records) -> str:
    """Return a table of the methods."""
    rows = []
    for method, strategy in METHODS.items():
        columns = new_columns(records, method)
        way_m = np.array([record["distance_m"] for record in records[cell_id(method)]], float)
        shown = [f"{mean_interval(columns[:, n]):,.0f}" for n in (FEW, MORE, STEPS)]
        rows.append([str(method), strategy, *shown, f"{way_m.mean():.1f}"])
    heads = [f"new columns after {n} steps" for n in (FEW, MORE, STEPS)]
    return markdown_table(["method", "strategy", *heads, "way (m)"], rows)


def _field_table(records: Records) -> str:
    """Return figs. 29, 31 and 32 in numbers: methods 3 and 5 over the first steps."""
    rows, steps = [], sorted({1, 2, FEW // 2, FEW})
    for method in (3, 5):
        columns = new_columns(records, method)
        left = [interest_in(records, part, FEW).mean() for part in ("unreadable", "readable")]
        rows.append(
            [
                str(method),
                *(f"{mean_interval(columns[:, n]):,.0f}" for n in steps),
                f"{mean_interval(answered(records, method, FEW)):.2f}",
                "{:.2f}, {:.2f}".format(*left) if method == 5 else "–",
            ]
        )
    head = [f"fig. 29: new columns after {n} step{'s' * (n > 1)}" for n in steps]
    head.append(f"fig. 31: obtained of expected in {FEW} looks")
    head.append(f"fig. 32: interest left after {FEW} steps, unreadable and readable ground")
    return markdown_table(["method", *head], rows)


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
