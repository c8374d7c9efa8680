"""The report of Bhattacharya 2010: Markdown with the claims, figures 2, 3, 4 and 6 beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from baselines.cli.figures import STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.machine import processor
from baselines.experiments.statistics import median_interval
from baselines.experiments.tables import csv_table, markdown_table
from baselines.papers.bhattacharya.claims import (
    STARTS,
    Records,
    covering,
    exploring,
    first_floor,
    until_explored,
)
from baselines.papers.bhattacharya.discussion import (
    CHANGED_READING,
    CHANNEL_READING,
    COVERAGE_READING,
    EXPLORATION_READING,
    FLYING_READING,
    SPLIT_READING,
)
from baselines.papers.bhattacharya.figures import figure_2, figure_3, figure_4, figure_6, figure_progress
from baselines.papers.bhattacharya.missions import Records as MissionRecords
from baselines.papers.bhattacharya.missions import channel_table, flying_table
from baselines.papers.bhattacharya.run import Run
from baselines.papers.bhattacharya.sweep import (
    CONTROLS,
    FLOORS,
    FUSIONS,
    PICTURED,
    VARIANTS,
    coverage_id,
    exploration_id,
)
from baselines.papers.bhattacharya.timing import Seconds
from entropy_explore_env.errors import counted
from entropy_explore_env.writing import write_atomically


@dataclass(frozen=True)
class Results:
    """What was measured."""

    runs: list[Run]
    records: Records
    splits: dict[str, Any]
    timing: Seconds
    changed: float
    """Share of cells whose cost or owner changes from one tessellation to the next."""
    missions: MissionRecords
    """By cell; none if no missions were run."""
    folder: Path
    """Of the runs' files."""


def write_report(folder: Path, results: Results, claims: Sequence[Claim], command: str) -> Path:
    """Write `bhattacharya.md` and, in a folder `bhattacharya` beside it, its figures; returns the page."""
    beside, runs = folder / "bhattacharya", {run.id: run for run in results.runs}
    with mpl.rc_context(STYLE):
        rows = []
        for control, name in (
            ("gradient", "gradient search"),
            ("projected-guarded", "projected centroid, guarded"),
        ):
            run = runs[coverage_id(control, "cluster", 0)]
            rows.append((name, run, results.records[run.id]))
        write_atomically(beside / "figure-2.png", png(figure_2(rows[0][1])))
        write_atomically(beside / "figure-3.png", png(figure_3(rows)))
        write_atomically(beside / "figure-4.png", png(figure_4()))
        for variant, name in zip(
            PICTURED, ("the paper's settings", "plain cells, nearest target"), strict=True
        ):
            floor = first_floor(results.records, variant)
            run = runs[exploration_id(floor, variant, FLOORS[floor].middle, 0)]
            with np.load(results.folder / f"{run.id}.npz") as maps:
                size = f"{run.shape[0]} × {run.shape[1]} cells"
                title = (
                    f"{size}, {counted(run.robots, 'robot')}, range {run.rules.sensor.range_cells:g}; {name}"
                )
                picture = figure_6(run, results.records[run.id], dict(maps), title)
            write_atomically(beside / f"figure-6-{variant}.png", png(picture))
        lines = [
            (name, exploring(results.records, "small", name, FLOORS["small"].middle)[0])
            for name in ("paper", *VARIANTS)
        ]
        write_atomically(beside / "progress.png", png(figure_progress(lines)))
    columns: dict[str, list[object]] = {"variant": [], "iteration": [], "uncertain": []}
    for name, record in lines:
        columns["variant"] += [name] * len(record["series"]["iteration"])
        columns["iteration"] += record["series"]["iteration"]
        columns["uncertain"] += record["series"]["uncertain"]
    write_atomically(beside / "progress.csv", csv_table(columns))
    write_atomically(folder / "bhattacharya.md", _text(results, claims, command))
    return folder / "bhattacharya.md"


def _text(results: Results, claims: Sequence[Claim], command: str) -> str:
    held = sum(claim.holds for claim in claims)
    missions = sum(map(len, results.missions.values()))
    parts = [
        "# Bhattacharya, Michael and Kumar 2010, reproduced",
        f"Written by `{command}`: {len(results.runs)} runs and {missions} missions. Plans, starts and lost "
        "messages come from seeds 0, 1, …, the same for all variants; intervals are 95 % bootstrap intervals "
        "over seeds; one of fewer than five runs is hardly more than their span, and the tables say how many "
        "there are. Point robots step from cell to cell, as there.",
        f"## Claims: {held} of {len(claims)} hold",
        "A claim with an interval holds if all of it says so; iterations and seconds of (b) hold by their "
        f"median. Seconds are processor time on one thread of a machine with {processor()}, the paper's "
        "those of a 2.1 GHz Pentium of 2010.",
        claims_table(claims),
        "## (a), (d) A known office, 170 × 200, five robots",
        _coverage_table(results),
        COVERAGE_READING,
        "![Cells](bhattacharya/figure-2.png)",
        "![Cells and ways](bhattacharya/figure-3.png)",
        "## (b) Exploration and coverage of an unknown plan, four robots from the lower left",
        *_exploration_parts(results),
        "## (c) Splitting an unknown region",
        _split_table(results.splits),
        SPLIT_READING,
        "![Fig. 4](bhattacharya/figure-4.png)",
    ]
    if flying := flying_table(results.missions):
        parts += ["## (e) Flying teams, in this package's missions", FLYING_READING, flying]
    if results.missions:
        parts += [
            "## (f) Both channel schemes at equal bits a scan",
            CHANNEL_READING,
            channel_table(results.missions),
        ]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _exploration_parts(results: Results) -> list[str]:
    parts = [EXPLORATION_READING]
    for name, floor in FLOORS.items():
        if table := _exploration_table(results.records, name):
            size = " × ".join(map(str, floor.shape))
            parts += [f"### {name.capitalize()}: {size} cells, {floor.text}", table]
            parts += [_sweep_reading(results.records, name)] if len(floor.ranges) > 1 else []
    return [
        *parts,
        "![Fig. 6](bhattacharya/figure-6-paper.png)",
        "![Fig. 6, ours](bhattacharya/figure-6-nearest-length.png)",
        "![Progress](bhattacharya/progress.png)",
        CHANGED_READING.format(results.changed),
        "### Readings from far away",
        _fusion_table(results),
    ]


def _sweep_reading(records: Records, floor: str) -> str:
    """Which of the sensor ranges gives the paper's iterations."""
    done, ranges = {}, FLOORS[floor].ranges
    for range_cells in ranges:
        found = exploring(records, floor, "paper", range_cells)
        if found and all(r["ended"] == "converged" for r in found):
            done[range_cells] = float(np.median([r["iterations"] for r in found]))
    most = FLOORS[floor].paper
    within = [range_cells for range_cells, iterations in done.items() if iterations <= most]
    swept = ", ".join(f"{range_cells:g}" for range_cells in ranges)
    if within:
        return f"Of the ranges {swept} the least that ends within {most:,} iterations is {min(within):g}."
    fewest = f": the fewest are {min(done.values()):,.0f}" if done else ""
    return f"None of the ranges {swept} ends within {most:,} iterations{fewest}."


def _coverage_table(results: Results) -> str:
    rows = []
    for control in CONTROLS:
        for starts in STARTS:
            found = covering(results.records, control, starts)
            done = [r["iterations"] for r in found if r["ended"] == "converged"]
            cycles = sorted(r["cycle"] for r in found if r["ended"] == "cycle")
            last = np.mean([r["functional_last"] / r["functional_first"] for r in found])
            rows.append(
                [
                    control,
                    starts,
                    len(found),
                    len(done),
                    "{:,.0f} ({:,.0f} … {:,.0f})".format(*median_interval(done)) if done else "-",
                    f"{cycles[0]} … {cycles[-1]}" if cycles else "-",
                    f"{np.mean([r['rises'] for r in found]):.1f}",
                    f"{max(r['largest_rise'] for r in found):.2%}",
                    f"{last:.3f}",
                    f"{1e3 * np.median([r['seconds_an_iteration'] for r in found]):.1f}",
                ]
            )
    head = ["control", "starts", "runs", "converged", "median iterations", "limit cycles", "rises of H a run"]
    return markdown_table([*head, "largest rise", "H at the end over H at first", "ms an iteration"], rows)


def _exploration_table(records: Records, name: str) -> str:
    floor = FLOORS[name]
    points = [("paper", r) for r in floor.ranges]
    points += [(variant, floor.middle) for variant in floor.variants if variant not in FUSIONS]
    rows = []
    for variant, range_cells in points:
        found = exploring(records, name, variant, range_cells)
        if found:
            explored = [r for r in found if r["explored_at"] is not None]
            ended = [r["iterations"] for r in found if r["ended"] == "converged"]
            rows.append(
                [
                    variant,
                    f"{range_cells:g}",
                    f"{len(explored)}, {len(ended)} of {len(found)}",
                    _median([until_explored(r) for r in found], len(explored) == len(found)),
                    _median([r["iterations"] for r in found], len(ended) == len(found)),
                    f"{1e3 * np.median([r['seconds_with_tessellation'] for r in found]):.0f}",
                    f"{1e3 * np.mean([r['seconds_an_iteration'] for r in found]):.0f}",
                    f"{bits / 1e6:,.0f}" if (bits := np.mean([r["bits"] for r in found])) else "-",
                ]
            )
    head = ["variant", "range (cells)", "explored, converged", "all explored at", "iterations in all"]
    return markdown_table([*head, "ms with cells", "ms mean", "Mbit sent"], rows) if rows else ""


def _median(values: Sequence[float], ended: bool) -> str:
    """Median with its interval; where not all runs ended, it is a bound."""
    middle, low, high = median_interval(values)
    beyond = "" if ended else "≥ "
    return f"{beyond}{middle:,.0f}" + (f" ({low:,.0f} … {high:,.0f})" if len(values) > 1 else "")


def _fusion_table(results: Results) -> str:
    words = {
        "paper": "τ above the entropy of a far reading, arithmetic mean of all readings",
        "far-mean": "τ below it, arithmetic mean of all readings",
        "far-best": "τ below it, the most confident reading is kept",
    }
    rows = []
    for name in ("paper", *FUSIONS):
        first = exploring(results.records, "small", name, FLOORS["small"].middle)[0]
        at = first["explored_at"]
        rows.append([words[name], "never" if at is None else f"{at:,}", f"{first['uncertain_left']:,}"])
    size = " × ".join(map(str, FLOORS["small"].shape))
    return markdown_table([f"{size} cells, first plan", "all explored at", "uncertain cells left"], rows)


def _split_table(splits: dict[str, Any]) -> str:
    names = list(next(iter(splits.values())))
    rows = [[region, *(f"{ratios[name]:.2f}" for name in names)] for region, ratios in splits.items()]
    head = ["unknown region", "plain cells", *(f"η = {name}" for name in names[1:])]
    return markdown_table(head, rows)
