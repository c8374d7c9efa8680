"""The report of RochaMI: Markdown with the claims and what was found, figures and their tables beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from baselines.cli.figures import STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.statistics import holm, mean_interval, paired_p, ratio_interval
from baselines.experiments.tables import csv_table, markdown_table
from baselines.papers.rochami.claims import Records, distances, teams_in, times
from baselines.papers.rochami.discussion import reading
from baselines.papers.rochami.figures import (
    figure_6,
    figure_7,
    figure_changes,
    figure_coverage,
    figure_sharing,
    median_text,
)
from baselines.papers.rochami.sweep import (
    BLOCKED,
    CHANGES,
    END_SIGMA,
    FEW,
    METHODS,
    TIME_LIMIT_S,
    cell_id,
    change_id,
)
from entropy_explore_env.writing import write_atomically

FIGURES = ("figure-6", "figure-7", "coverage", "changes", "sharing")


def write_report(folder: Path, records: Records, claims: Sequence[Claim], command: str) -> Path:
    """Write `rochami.md` and, in a folder `rochami` beside it, its figures and tables.

    Returns:
        Path of the report.
    """
    beside = folder / "rochami"
    with mpl.rc_context(STYLE):
        pictures = (figure_6, figure_7, figure_coverage, figure_changes, figure_sharing)
        for name, draw in zip(FIGURES, pictures, strict=True):
            figure, table = draw(records)
            write_atomically(beside / f"{name}.png", png(figure))
            write_atomically(beside / f"{name}.csv", csv_table(table))
    write_atomically(folder / "rochami.md", _text(records, claims, command))
    return folder / "rochami.md"


def _text(records: Records, claims: Sequence[Claim], command: str) -> str:
    starts = len(records[cell_id(1, "coordinated")])
    missions = sum(len(cell) for cell in records.values())
    capped = sum(not record["finished"] for cell in records.values() for record in cell)
    held = sum(claim.holds for claim in claims)
    parts = [
        "# Rocha, coordination by mutual information, reproduced",
        f"Written by `{command}`: {missions:,} missions, {starts} paired starts and worlds a point, seeds 0, "
        "1, …, the same in every cell. Intervals are 95 % bootstrap intervals over missions, of means unless "
        f"they say otherwise; {capped} missions were cut off at {TIME_LIMIT_S:g} s, and count with it. The "
        "figures' numbers lie as CSV in `rochami/`.",
        _RULES,
        f"## Claims: {held} of {len(claims)} hold",
        _HOLDS,
        claims_table(claims, interval_digits=3),
        "## Team sizes",
        "![Figure 6](rochami/figure-6.png)",
        *(_teams_table(records, blocked) for blocked in BLOCKED),
        "## What is covered",
        "![Coverage](rochami/coverage.png)",
        "## Cost of distance",
        "![Figure 7](rochami/figure-7.png)",
        "## One thing changed at a time",
        _CHANGED,
        "![Changes](rochami/changes.png)",
        _changes_table(records),
        "## What was found",
        reading(records),
        "## A steered I_min (Rocha04, sect. 5.1.1)",
        _SHARING,
        "![Steered I_min](rochami/sharing.png)",
    ]
    return "\n\n".join(part.strip() for part in parts) + "\n"


_RULES = f"""The scenario `lab`: 5.0 × 4.6 × 2.0 m, 23 m², voxels of 0.1 m, ground robots with bodies of
0.2 m radius and a stereo-like sensor of 45° × 30° up to 4 m; candidates lie within r̂ (at least 0.5 m).
The paper ends a mission at H(C) < 500 in its discrete entropy, of which it gives neither levels nor
H(0): about 1 % of H(0), should a voxel hold a bit. Here a mission ends when the entropy of the best map
falls to that of all visible voxels at σ = {END_SIGMA:g}: by then one or two in a hundred voxels of the
robots' layer, in which they look for gradients, are left. Both methods are one rule with the same ρ of
obstacles and the same escape from traps; the uncoordinated one has λ = η = 1 and hears no announcement.
One robot is the same in both. What a robot does behind a teammate the paper does not say: it waits for
5 s, or it wanders (a random viewpoint)."""

_HOLDS = """What holds means: "coordinated is faster" is a paired Wilcoxon signed-rank test, one-sided,
over all team sizes of a setting corrected by Holm, p < 0.01; a figure of the paper holds if it lies in
our interval; "falls", "rises" and "monotone" ask for every step of the means and for the whole
interval; "≥ 1" and "not slower" hold unless the whole interval contradicts them; "levels off" allows a
tenth."""

_CHANGED = """Mean mission times with blocked robots that wait; the ratio is coordinated over
uncoordinated with its interval, p of the paired test corrected over the table. A change that does not
concern the uncoordinated method is compared with that as it is."""

_SHARING = """Rocha04 leaves to further work an I_min that is "adaptively controlled and reduced along
the mission". With `Channel.i_min_fill` each robot moves its I_min after every scan so that on average a
share of the burst reaches it. Rocha04's room, its gradient strategy, burst 64; the numbers at the
points are I_min in bits, or the share. Below a line at the same number of bits means faster for the
same traffic."""


def _teams_table(records: Records, blocked: str) -> str:
    """Every team size and method of one setting, with medians and the missions cut off."""
    rows = []
    for n in (1, *teams_in(records)):
        methods = ("coordinated", "random") if n == 1 else METHODS
        for method in methods:
            found, sample = records[cell_id(n, method, blocked)], times(records, cell_id(n, method, blocked))
            scans = np.mean([record["scans"] for record in found]) / n
            blocks = np.mean([record["blocked_moves"] / record["scans"] for record in found])
            rows.append(
                [
                    n,
                    "rule" if n == 1 and method != "random" else method,
                    "{:,.0f} ({:,.0f} … {:,.0f})".format(*mean_interval(sample)),
                    median_text(sample),
                    sum(not record["finished"] for record in found),
                    f"{scans:.0f}",
                    f"{blocks:.0%}",
                    f"{distances(records, cell_id(n, method, blocked)).mean():.1f}",
                ]
            )
    head = [
        "robots",
        "method",
        "mean t (s)",
        "median t (s)",
        "cut off",
        "scans a robot",
        "blocked",
        "m a robot",
    ]
    return f"Blocked robots {blocked}:\n\n" + markdown_table(head, rows)


def _changes_table(records: Records) -> str:
    """Both methods with one thing changed."""
    names = [None, *(name for name in CHANGES if change_id(name, FEW[0], "coordinated") in records)]
    rows, p_values = [], []
    for name in names:
        for n in FEW:
            cells = [cell_id(n, m) if name is None else change_id(name, n, m) for m in METHODS[:2]]
            starts = min(len(records[cell]) for cell in cells)
            pair = [times(records, cell)[:starts] for cell in cells]
            p_values.append(paired_p(*pair))
            cut = [sum(not record["finished"] for record in records[cell]) for cell in cells]
            rows.append(
                [
                    "as it is" if name is None else CHANGES[name].text,
                    n,
                    *(f"{sample.mean():,.0f} ({np.median(sample):,.0f})" for sample in pair),
                    "{:.2f} ({:.2f} … {:.2f})".format(*ratio_interval(*pair)),
                    f"{cut[0]} + {cut[1]}",
                ]
            )
    for row, p in zip(rows, holm(p_values), strict=True):
        row.append(f"{p:.1g}")
    head = ["changed", "robots", "coordinated (median)", "uncoordinated (median)", "ratio", "cut off", "p"]
    return markdown_table(head, rows)
