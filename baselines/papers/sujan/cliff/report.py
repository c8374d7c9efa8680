"""The report of Sujan's cliff: Markdown with the claims, and figures 7, 9 and 24-27 beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from baselines.cli.figures import STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.statistics import mean_interval
from baselines.experiments.tables import csv_table, markdown_table
from baselines.papers.sujan.cliff.claims import (
    FEW,
    MORE,
    Records,
    interest_in,
    looks_of,
    new_columns,
    steps_needed,
)
from baselines.papers.sujan.cliff.figures import figure_columns, figure_looks, figure_views
from baselines.papers.sujan.cliff.samples import edge_of_world, figure_completion, figure_edge, samples
from baselines.papers.sujan.cliff.sweep import LOOKS, METHODS, STEPS, cell_id
from entropy_explore_env.writing import write_atomically


def write_report(folder: Path, records: Records, claims: Sequence[Claim], command: str) -> Path:
    """Write `sujan-cliff.md` and, in a folder `sujan-cliff` beside it, its figures and tables.

    Returns:
        Path of the report.
    """
    beside = folder / "sujan-cliff"
    with mpl.rc_context(STYLE):
        for name, drawn in (("figure-24", figure_columns), ("figure-26", figure_looks)):
            figure, table = drawn(records)
            write_atomically(beside / f"{name}.png", png(figure))
            write_atomically(beside / f"{name}.csv", csv_table(table))
        figures = {"figure-7": figure_completion, "figure-9": figure_edge, "figure-25": figure_views}
        for name, made in figures.items():
            write_atomically(beside / f"{name}.png", png(made()))
    write_atomically(folder / "sujan-cliff.md", _text(records, claims, command))
    return folder / "sujan-cliff.md"


_ABOUT = """\
Written by `{command}`: {worlds} worlds of `cliff`, one mission in each with every method,
seeds 0, 1, …, all from the same place on the plateau; {looks} first looks around, which are no steps, and
{steps} steps, a scan each. Columns are those of the elevation map, 0.125 m wide; those that the first looks
map are not counted. Intervals are 95 % paired bootstrap intervals over worlds. The rover knows where it is.
The drop here is vertical; the paper's field test on a slope of 75° follows as far as its text goes."""


def _text(records: Records, claims: Sequence[Claim], command: str) -> str:
    """The report."""
    worlds = len(records[cell_id(5)])
    parts = [
        "# Sujan and Meggiolaro, the cliff reproduced",
        _ABOUT.format(command=command, worlds=worlds, looks=LOOKS, steps=STEPS),
        f"## Claims: {sum(claim.holds for claim in claims)} of {len(claims)} hold",
        "A claim with a number holds if the interval reaches it, others if the whole interval says so.",
        claims_table(claims),
        "## The methods",
        _methods_table(records),
        "![Figure 24](sujan-cliff/figure-24.png)",
        "![Figure 26](sujan-cliff/figure-26.png)",
        "![Figures 25 and 27](sujan-cliff/figure-25.png)",
        "Columns that are mapped, coloured by their height, and the interest in each; the ground within the "
        "dotted line is unreadable.",
        "## What does not hold, and why",
        _reading(records),
        "## The field test, figs. 28-32",
        _FIELD,
        _field_table(records),
        "## Unknown heights, and the edge",
        _samples_table(),
        "![Figure 7](sujan-cliff/figure-7.png)",
        _edge_text(),
        "![Figure 9](sujan-cliff/figure-9.png)",
    ]
    return "\n\n".join(parts) + "\n"


def _methods_table(records: Records) -> str:
    rows = []
    for method, strategy in METHODS.items():
        columns = new_columns(records, method)
        way_m = np.array([record["distance_m"] for record in records[cell_id(method)]], float)
        at = [mean_interval(columns[:, n]) for n in (FEW, MORE, STEPS)]
        shown = ["{:,.0f} ({:,.0f} … {:,.0f})".format(*interval) for interval in at]
        rows.append([str(method), strategy, *shown, f"{way_m.mean():.1f}"])
    heads = [f"new columns after {n} steps" for n in (FEW, MORE, STEPS)]
    return markdown_table(["method", "strategy", *heads, "way (m)"], rows)


_READING = """\
- Method 1 maps {first:,.0f} new columns in {few} steps, {share:.0%} of what method 5 maps, and {last:,.0f} in
  {steps}: each of its looks shows ground that none before it showed, until no place of its lattice is left
  that it knows. The paper gives neither the spacing of its raster nor the view of its camera.
- The looks of methods 3, 4 and 5 show {three:.0%}, {four:.0%} and {five:.0%} of the new columns that they
  should in {more} steps.
- Method 5 takes {needed:.2f} of {more} steps for what method 3 maps in them. Its interest function lets go of
  unreadable ground only in the long run: the mean interest in it is {dark_few:.2f} after {few} steps and
  {dark_last:.2f} after {steps}, in readable ground {lit_few:.2f} and {lit_last:.2f}. That falls, too, since
  columns behind rocks and behind the edge do not answer either, and while they are unknown eq. 5 takes many
  of them for visible."""


def _reading(records: Records) -> str:
    first, best = (new_columns(records, method) for method in (1, 5))
    answered = [
        looks_of(records, method, "obtained", MORE).sum() / looks_of(records, method, "expected", MORE).sum()
        for method in (3, 4, 5)
    ]
    return _READING.format(
        first=first[:, FEW].mean(),
        last=first[:, STEPS].mean(),
        share=first[:, FEW].mean() / best[:, FEW].mean(),
        few=FEW,
        more=MORE,
        steps=STEPS,
        three=answered[0],
        four=answered[1],
        five=answered[2],
        needed=steps_needed(records).mean(),
        dark_few=interest_in(records, "unreadable", FEW).mean(),
        dark_last=interest_in(records, "unreadable", STEPS).mean(),
        lit_few=interest_in(records, "readable", FEW).mean(),
        lit_last=interest_in(records, "readable", STEPS).mean(),
    )


_FIELD = """\
The paper maps a natural cliff with a slope of about 75° from above, by methods 3 and 5 alone and for 10 steps
of each. Its text gives no number of that, no map of the ground, no view of the camera and no place of the
rover. So fig. 28, a photograph of the robots, and fig. 30, one of the cliff beside its map, cannot be had,
and no ground here stands for that cliff: in voxels of 0.125 m a slope of 75° over 3 m is six columns wide,
and is seen from above like a vertical drop. What figs. 29, 31 and 32 show can be had above the cliff of this
page, from the same missions: new columns over the steps, expected and obtained ones, and the interest that
method 5 has left after 10 steps, which is drawn above beside fig. 25."""


def _field_table(records: Records) -> str:
    """Figs. 29, 31 and 32 in numbers: methods 3 and 5 over the first steps."""
    rows, steps = [], sorted({1, 2, FEW // 2, FEW})
    for method in (3, 5):
        columns = new_columns(records, method)
        mapped = ["{:,.0f} ({:,.0f} … {:,.0f})".format(*mean_interval(columns[:, n])) for n in steps]
        looks = [looks_of(records, method, field, FEW).sum(axis=1) for field in ("expected", "obtained")]
        answered = mean_interval(looks[1] / np.maximum(looks[0], 1.0)).text(".2f")
        left = [interest_in(records, part, FEW).mean() for part in ("unreadable", "readable")]
        interest = "{:.2f}, {:.2f}".format(*left) if method == 5 else "–"
        rows.append([str(method), *mapped, answered, interest])
    head = [f"fig. 29: new columns after {n} step{'s' * (n > 1)}" for n in steps]
    head.append(f"fig. 31: obtained of expected in {FEW} looks")
    head.append(f"fig. 32: interest left after {FEW} steps, unreadable and readable ground")
    return markdown_table(["method", *head], rows)


def _samples_table() -> str:
    rows = []
    for sample in samples():
        mean, most = sample.error_m
        spread = float(np.ptp(sample.height_m))
        errors = [f"{error / spread:.3f}" for error in (mean, most)]
        rows.append([sample.name, f"{(~sample.known).mean():.0%}", *errors])
    return markdown_table(["sample of fig. 7", "unknown", "rms error / range", "largest / range"], rows)


def _edge_text() -> str:
    counts = [(len(edge.border) - 1, len(edge.polygon) - 1) for _, edge in map(edge_of_world, range(3))]
    listed = ", ".join(f"{corners} of {points}" for points, corners in counts)
    return (
        "The border of the plateau in the true heights of worlds 0-2, and the polygon that is a wheel's "
        f"diameter, 0.2 m, from it at most: corners of border points {listed}."
    )
