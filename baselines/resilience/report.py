"""The page: what was run, the claims, figures and tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from baselines.cli.figures import STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.tables import csv_table, markdown_table
from baselines.resilience.claims import MARGIN, missions_cut_off
from baselines.resilience.figures import fault_figure, loss_figure
from baselines.resilience.sweep import (
    CHANNELS,
    RANGE_M,
    STRATEGIES,
    TEXTS,
    Experiment,
    Records,
    cell_id,
    conditions,
    times,
)
from entropy_explore_env.writing import write_atomically

PAGE, FILES = "resilience.md", "resilience"


def write_report(
    folder: Path, experiment: Experiment, records: Records, claims: Sequence[Claim], command: str
) -> Path:
    """Write `resilience.md` and, in a folder `resilience` beside it, its figures and tables.

    Returns:
        Path of the page.
    """
    beside = folder / FILES
    with mpl.rc_context(STYLE):
        for name, draw in (("loss", loss_figure), ("faults", fault_figure)):
            figure, table = draw(experiment, records)
            write_atomically(beside / f"{name}.png", png(figure))
            write_atomically(beside / f"{name}.csv", csv_table(table))
    write_atomically(folder / PAGE, _text(experiment, records, claims, command))
    return folder / PAGE


def _text(experiment: Experiment, records: Records, claims: Sequence[Claim], command: str) -> str:
    missions = sum(len(cell) for cell in records.values())
    cut = sum(missions_cut_off(records, cell) for cell in records)
    held = sum(claim.holds for claim in claims)
    parts = [
        "# Teams whose robots and messages fail",
        f"Written by `{command}`: {missions:,} missions, {experiment.seeds} a point, seeds 0, 1, …, the "
        "same in every cell: worlds, starts and noise are the same with and without faults. Intervals "
        f"hold 95 % (bootstrap). {cut} missions were cut off at "
        f"{experiment.time_limit_s:g} s of simulated time, and count with it: ratios of strategies that are "
        "cut off are too near to 1.",
        _READING,
        "## What fails",
        markdown_table(["condition", "what it is"], [[TEXTS[name], _SAID[name]] for name in conditions()]),
        "## Lost messages",
        "![Lost messages](resilience/loss.png)",
        "## All else that fails",
        "![Faults](resilience/faults.png)",
        "## Mission times",
        *(_times_table(experiment, records, *team) for team in experiment.teams),
        f"## Claims: {held} of {len(claims)} hold",
        _HOLDS,
        "\n".join(f"- {line}" for line in findings(experiment, claims)),
        claims_table(claims, 3, given="allowed"),
        *explanations(experiment),
        "Files: [`loss.csv`](resilience/loss.csv), [`faults.csv`](resilience/faults.csv).",
    ]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def explanations(experiment: Experiment) -> list[str]:
    """What was written by hand of its missions: figures there are of no others."""
    if experiment.strategies != STRATEGIES or (experiment.seeds, experiment.time_limit_s) != (5, 1000.0):
        return []
    teams = set(experiment.teams)
    said = [text for those, text in _WHY.items() if set(those) <= teams]
    return ["## Why some are not shown", *said] if said else []


def findings(experiment: Experiment, claims: Sequence[Claim]) -> list[str]:
    """A line for each kind of claim: teams that it holds for, does not hold for, and is not shown for."""
    lines = []
    for kind, text in _KINDS.items():
        teams: dict[str, list[str]] = {"holds for": [], "does not hold for": [], "not shown for": []}
        for scenario, robots in experiment.teams:
            for strategy in experiment.strategies:
                claim = next(c for c in claims if c.id == f"{kind}-{scenario}-{robots}-{strategy}")
                most = float(str(claim.paper).removeprefix("≤ ")) * MARGIN
                broken = claim.low is not None and claim.low > most
                said = "holds for" if claim.holds else "does not hold for" if broken else "not shown for"
                teams[said].append(f"`{strategy}` ({scenario}, {robots})")
        found = "; ".join(f"{said} {', '.join(names)}" for said, names in teams.items() if names)
        lines.append(f"{text} {found}.")
    return lines


_KINDS = {
    "isolated": "Under every fault never slower than in isolation:",
    "lost": "Losing one robot costs at most its share:",
}
"""Beginning of the ids of claims of one kind, and what they are."""

_READING = """A mission ends, as its scenario says, when one map is known; a mission time is therefore that of
the best-informed robot. A strategy gains from its teammates what lies between "nothing fails" and "isolated":
how much of that a fault takes away is what the figures show. Silent teammates count as silent after
`Channel.silent_after_s` (10 s beyond what one decision may take): what they announced is free then."""

_HOLDS = f""""Never slower than in isolation" compares each condition with the same robots that tell each
other nothing (where a robot is lost, with isolated robots of which the same one is lost). "At most its
share": the team that lost one of A robots at half time needs at most ½ + ½ · A/(A - 1) of the time. Both hold
only where the whole interval of every ratio lies below {MARGIN:g} times what is allowed, and no mission of
the faulty team was cut off: few seeds, or missions that were cut off, show nothing."""

_WHY_ROOM = """In the room, with the five seeds; one thing is changed at a time. Here and in the office
`assigned-frontier` was run with groups of half a sensor's range, its default then; now it is a quarter.

- `mutual-information`: isolated robots are not done in 1000 s, and missions that are cut off show nothing.
- `coordinated-frontier` and `assigned-frontier`, one of two robots lost: 1.60 and 1.48 of the time. A
mission ends when one map is known: two robots are two chances, the survivor is one. Where the second robot
is silent from half time on instead of lost, 1.33 and 1.31 are left. It is not what the lost robot had not
told: with all rays shared `coordinated-frontier` takes 1.79. What it had announced stays taken for 10 s, a
small part of it: with `Channel.silent_after_s=1` 1.56 are left.
- `voronoi`, one of two robots lost: two robots are twice as quick as isolated ones (174 s and 349 s), so
that the survivor needs its share and no less, 1.49 where 1.5 is allowed. Where the second one is silent
instead, it is the same, 1.50.
- `coordinated-frontier`, `assigned-frontier` and `voronoi`, never slower than in isolation: where next to
nothing arrives (90 % lost, a range of 3 m, a robot lost) they are as quick as isolated robots, by other
ways: the ratios are 0.95 to 1.07, and with five seeds an interval reaches 5 to 14 % farther.

Where only viewpoints were announced, `coordinated-frontier` with four robots had been slower than in
isolation (1.22), since it left frontiers to teammates whose scans never came. With teammates' targets left
out 1.03 was left of it, with all that was heard left out 1.00. It leaves them nothing any more where no
scans are shared; so do `assigned-frontier`, `voronoi` and `per-time-visibility`."""

_WHY_OFFICE = """In the office, with four robots:

- `assigned-frontier`, one robot lost: in one of five missions the robot stopped in a corridor, and the others
were stopped by its body 950 times. Paths are planned through what is known to be free, bodies are not in the
map. The other four took 0.99 to 1.24 of the time.
- `mutual-information` and `voronoi`: isolated robots are not done in 1000 s.
- `planned-rate`, `per-time-visibility`, `voronoi` and `mutual-information`, one robot lost: 1.23, 1.23, 1.19
and 1.13 where 1.17 is allowed, with intervals that hold both answers; likewise `per-time-visibility` where
only viewpoints are announced, 1.01 of isolation."""

_WHY = {(("room", 2), ("room", 4)): _WHY_ROOM, (("office", 4),): _WHY_OFFICE}
"""Teams → why claims of theirs are not shown, of the missions of `explanations`."""

_SAID = {
    **{
        name: f"`Channel.loss_probability={c['loss_probability']:g}`"
        for name, c in CHANNELS.items()
        if "loss" in name
    },
    "burst-0": "`Channel.burst=0`: viewpoints are announced, measurements are not sent",
    "range": f"`Channel.range_m={RANGE_M:g}`",
    "sight": "`Channel.reach='line_of_sight'`: no solid voxel of the true world in between; "
    "where nothing stands in the way, as in an empty room, it changes nothing",
    "isolated": "`Channel.burst=0, announcements=False`",
    "lost": "the last robot stops for good (`Faults.stop`) at half the median time without faults",
    "lost-isolated": "the same, in isolation",
}


def _times_table(experiment: Experiment, records: Records, scenario: str, robots: int) -> str:
    """Median times under every condition, and how many missions were cut off."""
    rows = []
    for strategy in experiment.strategies:
        row = [f"`{strategy}`"]
        for name in conditions():
            cell = cell_id(scenario, robots, strategy, name)
            found = times(records, cell)
            cut = missions_cut_off(records, cell)
            known = found[np.isfinite(found)]
            median = f"{np.median(known):,.0f}" if len(known) else "-"
            row.append(median + (f" ({cut})" if cut else ""))
        rows.append(row)
    head = ["strategy", *(TEXTS[name] for name in conditions())]
    cut_off = f"in brackets how many of {experiment.seeds} were cut off"
    title = f"{scenario}, {robots} robots: median seconds, {cut_off}"
    return title + ".\n\n" + markdown_table(head, rows)
