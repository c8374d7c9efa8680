"""The report of Bhattacharya 2010: Markdown with the claims, figures 2, 3, 4 and 6 beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from baselines.claims_table import claims_table
from baselines.experiment import Claim, csv_table, markdown_table, mean_interval, median_interval
from baselines.experiment import Record as MissionRecord
from baselines.figures import STYLE, png
from baselines.papers.bhattacharya_claims import STARTS, Records, covering, exploring
from baselines.papers.bhattacharya_figures import figure_4, figure_6, figure_progress, figures_2_3
from baselines.papers.bhattacharya_missions import (
    CHANNELS,
    FLYING,
    FLYING_LIMIT_S,
    LOSSES,
    channel_id,
    flying_id,
)
from baselines.papers.bhattacharya_runs import (
    CONTROLS,
    FUSIONS,
    QUICK_RANGE,
    VARIANTS,
    Run,
    coverage_id,
    exploration_id,
)
from entropy_explore_env.writing import write_atomically

MissionRecords = dict[str, list[MissionRecord]]


@dataclass(frozen=True)
class Results:
    """What was measured."""

    runs: list[Run]
    records: Records
    splits: dict[str, Any]
    timing: tuple[float, float]
    missions: MissionRecords
    middle: float
    folder: Path
    """Of the runs' files."""


def write_report(folder: Path, results: Results, claims: Sequence[Claim], command: str) -> Path:
    """Write `bhattacharya.md` and, in a folder `bhattacharya` beside it, its figures; returns the page."""
    beside, runs = folder / "bhattacharya", {run.id: run for run in results.runs}
    with mpl.rc_context(STYLE):
        rows = []
        for control, name in (("gradient", "gradient search"), ("projected-guarded", "projected centroid")):
            run = runs[coverage_id(control, "cluster", 0)]
            rows.append((name, run, results.records[run.id]))
        write_atomically(beside / "figures-2-3.png", png(figures_2_3(rows)))
        write_atomically(beside / "figure-4.png", png(figure_4()))
        for variant, name in (
            ("paper", "the paper's settings"),
            ("nearest-length", "plain cells, nearest target"),
        ):
            run = runs[exploration_id(variant, results.middle, 0)]
            with np.load(results.folder / f"{run.id}.npz") as maps:
                size = f"{run.shape[0]} × {run.shape[1]} cells"
                title = f"{size}, {run.robots} robots, range {results.middle:g}; {name}"
                picture = figure_6(run, results.records[run.id], dict(maps), title)
            write_atomically(beside / f"figure-6-{variant}.png", png(picture))
        lines = [(name, exploring(results.records, name, results.middle)[0]) for name in ("paper", *VARIANTS)]
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
    explored = [run for run in results.runs if run.id.startswith("exploration-paper")]
    shape = explored[0].shape
    parts = [
        "# Bhattacharya, Michael and Kumar 2010, reproduced",
        f"Written by `{command}`: {len(results.runs)} runs. Plans, starts and lost messages come from seeds "
        "0, 1, …, the same for all variants; intervals are 95 % bootstrap intervals over seeds. Point robots "
        f"step from cell to cell, as there; (b) explores plans of {shape[0]} × {shape[1]} cells.",
        f"## Claims: {held} of {len(claims)} hold",
        "A claim with an interval holds if all of it says so; iterations of (b) hold by their median. "
        "Seconds are processor time on one thread of this machine, the paper's those of a 2.1 GHz Pentium of "
        "2010.",
        claims_table(claims),
        "## (a), (d) A known office, 170 × 200, five robots",
        _coverage_table(results),
        _COVERAGE_READING,
        "![Cells and ways](bhattacharya/figures-2-3.png)",
        "## (b) Exploration and coverage of an unknown plan, four robots from the lower left",
        _exploration_table(results),
        _EXPLORATION_READING,
        "![Fig. 6](bhattacharya/figure-6-paper.png)",
        "![Fig. 6, ours](bhattacharya/figure-6-nearest-length.png)",
        "![Progress](bhattacharya/progress.png)",
        "### Readings from far away",
        _fusion_table(results),
        "## (c) Splitting an unknown region",
        _split_table(results.splits),
        _SPLIT_READING,
        "![Fig. 4](bhattacharya/figure-4.png)",
    ]
    if flying := _flying_table(results.missions):
        parts += ["## (e) Flying teams, in this package's missions", flying]
    if results.missions:
        parts += [
            "## (f) Both channel schemes at equal bits",
            _channel_table(results.missions),
            _CHANNEL_READING,
        ]
    return "\n\n".join(part.strip() for part in parts) + "\n"


_COVERAGE_READING = """The paper proves the fall of the functional for Lloyd's algorithm, and conjectures
convergence of the projected centroid (Conjecture 1). On the grid the conjecture fails where a run ends in
a limit cycle: the centroid projected into a cell that is not convex need not lower the functional, and
where it rises robots can come back to where they were. Robots that move only if their own functional
falls (guarded) cannot, and gradient search with the robot's own cell among the candidates does the same."""

_EXPLORATION_READING = """The paper gives neither sensor range nor confidence, τ, τ′ or η, nor more of the
plan than its size; ours: s_n = 0.99, s_f = 0.9, τ = 0.35 (above the entropy of the farthest reading,
0.33), τ′ = 0.33, η = 0.01. While exploring, targets are kept until they are reached, seen or blocked;
then robots cover, guarded. In unknown space the edge cost (e(s) + e(t))/2 + η‖s - t‖ hardly knows
lengths: a diagonal step costs what a straight one does, so that ways there are shortest by the number of
steps."""

_SPLIT_READING = """The entropy-weighted metric splits the region evenly only if it separates the robots
and η is small: around a patch both walk at hardly any cost, so that each enters it from its own side all
around, and the one that is nearer to more of its rim gets more."""

_CHANNEL_READING = """Office, three robots, `voronoi-nearest`, I_min = 0; the first four rows send 64
measurements a scan in all, the last two all 180. Utility = bits taken from the hearers' maps a bit sent.
Phases wait 10 s and repeat."""


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


def _exploration_table(results: Results) -> str:
    ranges = sorted(
        {r.rules.sensor.range_cells for r in results.runs if r.id.startswith("exploration-paper")}
    )
    rows = []
    for variant, range_cells in [*(("paper", r) for r in ranges), *((v, results.middle) for v in VARIANTS)]:
        found = exploring(results.records, variant, range_cells)
        if found:
            explored = [str(r["explored_at"]) if r["explored_at"] else "-" for r in found]
            rows.append(
                [
                    variant,
                    f"{range_cells:g}",
                    ", ".join(explored),
                    ", ".join(
                        f"{r['iterations']:,} {'' if r['ended'] == 'converged' else r['ended']}".strip()
                        for r in found
                    ),
                    f"{1e3 * np.median([r['seconds_with_tessellation'] for r in found]):.0f}",
                    f"{1e3 * np.mean([r['seconds_an_iteration'] for r in found]):.0f}",
                    f"{np.mean([r['bits'] for r in found]) / 1e6:,.0f}",
                ]
            )
    head = [
        "variant",
        "range (cells)",
        "all explored at",
        "iterations in all",
        "ms with cells",
        "ms mean",
        "Mbit sent",
    ]
    return markdown_table(head, rows)


def _fusion_table(results: Results) -> str:
    words = {
        "far-certain": "τ above the entropy of a far reading, mean",
        "far-mean": "τ below it, arithmetic mean of all readings",
        "far-best": "τ below it, the most confident reading is kept",
    }
    rows = []
    for name in FUSIONS:
        found = exploring(results.records, name, QUICK_RANGE)
        explored = [
            str(r["explored_at"]) if r["explored_at"] else f"never ({r['uncertain_left']:,} cells left)"
            for r in found
        ]
        rows.append([words[name], ", ".join(explored)])
    return markdown_table(["333 × 261 cells", "all explored at"], rows)


def _split_table(splits: dict[str, Any]) -> str:
    names = list(next(iter(splits.values())))
    rows = [[region, *(f"{ratios[name]:.2f}" for name in names)] for region, ratios in splits.items()]
    head = ["unknown region", "plain cells", *(f"η = {name}" for name in names[1:])]
    return markdown_table(head, rows)


def _flying_table(missions: MissionRecords) -> str:
    rows = []
    for world in ("cave", "corridor"):
        for strategy in FLYING:
            found = missions.get(flying_id(world, strategy), [])
            if found:
                rows.append(
                    [
                        world,
                        strategy,
                        sum(r["finished"] for r in found),
                        len(found),
                        "{:,.0f} ({:,.0f} … {:,.0f})".format(
                            *mean_interval([r["t_mission_s"] for r in found])
                        ),
                        f"{np.mean([r['joint']['explored'] for r in found]):.1%}",
                        f"{np.mean([r['scans'] for r in found]):,.0f}",
                    ]
                )
    if not rows:
        return ""
    head = ["world", "strategy", "mapped", "of", "mean t (s)", "explored", "scans"]
    return f"Four robots, cut off at {FLYING_LIMIT_S:g} s.\n\n" + markdown_table(head, rows)


def _channel_table(missions: MissionRecords) -> str:
    rows = []
    for loss in LOSSES:
        for channel in CHANNELS:
            found = missions[channel_id(channel, loss)]
            bits = [r["bits_sent"] / max(r["scans"], 1) for r in found]
            rows.append(
                [
                    f"{loss:g}",
                    channel,
                    "{:,.0f} ({:,.0f} … {:,.0f})".format(*mean_interval([r["t_mission_s"] for r in found])),
                    f"{np.mean([r['bits_sent'] for r in found]) / 1e6:.2f}",
                    f"{np.mean(bits):,.0f}",
                    "{:.3f} ({:.3f} … {:.3f})".format(
                        *mean_interval([r["bits_gained_per_bit_sent"] or 0.0 for r in found])
                    ),
                ]
            )
    head = ["loss", "channel", "mean t (s)", "Mbit sent", "bits sent a scan", "utility a bit sent"]
    return markdown_table(head, rows)
