"""An experiment as data: its trials, the claims judged by them, its figures, its tables and its page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from baselines.experiments.claims import Claim, claims_csv, groups_table, told
from baselines.experiments.page import Page
from baselines.experiments.rows import Record, origins_line
from baselines.experiments.statistics import Interval, ratio_interval
from baselines.experiments.trials import How, Trial, by_cell, run_trials
from entropy_explore_env.errors import SettingError
from entropy_explore_env.writing import write_atomically

Records = dict[str, list[Record]]
"""Cell → records by seed."""


def sample(records: Records, cell: str, figure: str = "t_mission_s") -> np.ndarray:
    """Return (N,) a figure of each mission of a cell, by seed; missions cut off count with their limit.

    Dots in the name of a figure lead into parts of a record, as in `joint.explored`.
    """
    found: list[Any] = list(records[cell])
    for name in figure.split("."):
        found = [each[name] for each in found]
    return np.asarray(found, float)


def ratio_of(records: Records, over: str, under: str, figure: str = "t_mission_s") -> Interval:
    """Return the mean of a figure in a cell over that in another; missions are paired by seed."""
    both = sample(records, over, figure), sample(records, under, figure)
    seeds = min(map(len, both))
    return ratio_interval(both[0][:seeds], both[1][:seeds])


def cut_off(records: Records) -> int:
    """Return how many missions the time limit ended."""
    return sum(not record["finished"] for cell in records.values() for record in cell)


@dataclass(frozen=True)
class Amount:
    """How much of an experiment is run.

    Attributes:
        quick: Fewer cells.
        seeds: Missions a cell.
    """

    quick: bool
    seeds: int


@dataclass(frozen=True)
class Experiment:
    """An experiment.

    Attributes:
        name: Of its table, its page and the folder of its figures.
        title: What people call it.
        template: Of its page.
        trials: All of its trials.
        claims: What is judged by their records.
        groups: Beginning of the ids of some claims → what they claim: a line of the page each.
        figures, tables, values: Name → what makes it from records; see `page.Page`.
        seeds, quick_seeds: Missions a cell, where no number is asked for.
        least_seeds: Fewest that can be judged.
    """

    name: str
    title: str
    template: Path
    trials: Callable[[Amount], Sequence[Trial]]
    claims: Callable[[Records], list[Claim]]
    groups: Mapping[str, str]
    figures: Mapping[str, Callable[[Records], Any]] = field(default_factory=dict)
    tables: Mapping[str, Callable[[Records], str]] = field(default_factory=dict)
    values: Mapping[str, Callable[[Records], Any]] = field(default_factory=dict)
    seeds: int = 30
    quick_seeds: int = 3
    least_seeds: int = 1

    def amount(self, quick: bool, seeds: int | None) -> Amount:
        """Return how much is run.

        Raises:
            SettingError: There are too few seeds.
        """
        chosen = (self.quick_seeds if quick else self.seeds) if seeds is None else seeds
        if chosen < self.least_seeds:
            raise SettingError("seeds", chosen, f"a whole number ≥ {self.least_seeds}")
        return Amount(quick, chosen)


def reproduce(
    experiment: Experiment, amount: Amount, table: Path, how: How, out: Path, command: str
) -> list[Claim]:
    """Run what is missing in an experiment's table, judge it and write its page; return its claims.

    In a folder beside the page lie its figures and `claims.csv`. The page says the command that makes it.
    """
    rows = [row for row in run_trials(experiment.trials(amount), table, how) if row is not None]
    records = by_cell(rows)
    claims = told(experiment.claims(records), experiment.groups)
    page = Page(
        experiment.template,
        {name: partial(draw, records) for name, draw in experiment.figures.items()},
        {name: partial(make, records) for name, make in experiment.tables.items()},
        {name: make(records) for name, make in experiment.values.items()},
        {
            "claims": groups_table(claims, experiment.groups).strip(),
            "held": f"{sum(claim.holds for claim in claims)} of {len(claims)} hold",
            "rows": origins_line(rows),
            "command": command,
            "seeds": amount.seeds,
            "quick": amount.quick,
        },
    )
    page.write(out, experiment.name)
    write_atomically(out / experiment.name / "claims.csv", claims_csv(claims))
    return claims
