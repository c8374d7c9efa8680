"""The report of Sujan: Markdown with the claims, and figures 20 and 22 beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from baselines.cli.figures import STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.experiments.tables import csv_table, markdown_table
from baselines.papers.sujan.claims import Records, at_end, mapped, mapped_per_metre
from baselines.papers.sujan.figures import figure_scans
from baselines.papers.sujan.sweep import CHANGES, METHODS, OTHERS, SCANS, TEAMS, cell_id
from entropy_explore_env.writing import write_atomically


def write_report(folder: Path, records: Records, claims: Sequence[Claim], command: str) -> Path:
    """Write `sujan.md` and, in a folder `sujan` beside it, its figures and tables.

    Returns:
        Path of the report.
    """
    beside = folder / "sujan"
    with mpl.rc_context(STYLE):
        for robots, name in zip(TEAMS, ("figure-20", "figure-22"), strict=True):
            figure, table = figure_scans(records, robots)
            write_atomically(beside / f"{name}.png", png(figure))
            write_atomically(beside / f"{name}.csv", csv_table(table))
    write_atomically(folder / "sujan.md", _text(records, claims, command))
    return folder / "sujan.md"


_ABOUT = """Written by `{command}`: {starts} worlds of `occlusions` (100 × 100 m, about 12 % covered), one
mission in each with every method, seeds 0, 1, …, all from the middle; {scans} scans of the team.
Intervals are 95 % paired bootstrap intervals over worlds. Robots know where they are, and a drive
leads wherever its robot wants, so that a decision is a scan. The paper's cliff, errors of
localization and shared summaries are not part of this page."""


def _text(records: Records, claims: Sequence[Claim], command: str) -> str:
    """The report."""
    starts = len(records[cell_id(1, "v")])
    parts = [
        "# Sujan and Meggiolaro, the planar experiments reproduced",
        _ABOUT.format(command=command, starts=starts, scans=SCANS),
        f"## Claims: {sum(claim.holds for claim in claims)} of {len(claims)} hold",
        f"A claim holds if the whole interval says so. What is mapped for the same scans is the mean of the "
        f"share mapped over {SCANS} scans.",
        claims_table(claims),
        "## The methods",
        _methods_table(records),
        "![Figure 20](sujan/figure-20.png)",
        "![Figure 22](sujan/figure-22.png)",
    ]
    if cell_id(1, f"v-{next(iter(CHANGES))}") in records:
        changes = "## Method (v) with one thing changed at a time"
        parts += [changes, _changes_table(records), "## What does not hold, and why", _reading(records)]
    return "\n\n".join(parts) + "\n"


def _row(records: Records, cell: str, first: list[str]) -> list[str]:
    """A cell's figures, after what it is."""
    share, way_m = (at_end(records, cell, field) for field in ("mapped", "driven_m_by_scan"))
    return [
        *first,
        "{:.3f} ({:.3f} … {:.3f})".format(*mean_interval(mapped(records, cell))),
        f"{share.mean():.3f}",
        f"{way_m.mean():,.0f}",
        "{:.3f} ({:.3f} … {:.3f})".format(*mean_interval(mapped_per_metre(records, cell))),
    ]


_HEAD = ["mean share mapped", f"share after {SCANS} scans", "way (m)", "share a 100 m"]


def _methods_table(records: Records) -> str:
    """Every method and what stands beside them."""
    rows = []
    for robots in TEAMS:
        for method, strategy in METHODS.items():
            rows.append(_row(records, cell_id(robots, method), [str(robots), f"({method}) {strategy}"]))
        if robots == 1:
            rows += [_row(records, cell_id(1, name), ["1", f"{name}, not the paper's"]) for name in OTHERS]
    return markdown_table(["robots", "method", *_HEAD], rows)


def _changes_table(records: Records) -> str:
    """Method (v), one robot, with one thing changed, and how much more it maps than it does."""
    base = mapped(records, cell_id(1, "v"))
    rows = [[*_row(records, cell_id(1, "v"), ["nothing"]), "1"]]
    for name, (text, _) in CHANGES.items():
        cell = cell_id(1, f"v-{name}")
        rows.append([*_row(records, cell, [text]), _ratio(mapped(records, cell), base)])
    return markdown_table(["changed", *_HEAD, "mean share over (v)'s"], rows)


_READING = """\
- Eq. 8 as printed does not find the pose that shows most, for two reasons together. Unknown cells with
  the mean occupancy of their neighbours are nearly free where the neighbours are, and count as nearly
  certain. And -q log2 q falls again where more than 1/e of the view lies in one interval, so that a
  view full of unknown cells is worth less than one half full. Either change alone gives {half} and
  {linear} of (v); both give {both}.
- With both changed it maps {over_iii} of what (iii) maps, on {way:.2f} of its way.
- (iii) and (iv) drive across the whole map for each scan, since they do not weigh the way. The paper's
  (iii) drives a little less than its (v): its poses may have been drawn nearby, which it does not say.
- Of the five methods raster drives least: it takes four scans from each place."""


def _reading(records: Records) -> str:
    """What the changes say of the claims that do not hold, in numbers from the same records."""
    base, most_unmapped = (mapped(records, cell_id(1, method)) for method in ("v", "iii"))
    changed = {name: mapped(records, cell_id(1, f"v-{name}")) for name in ("half", "linear", "half-linear")}
    ratios = {name: _ratio(values, base) for name, values in changed.items()}
    ways = [at_end(records, cell_id(1, name), "driven_m_by_scan").mean() for name in ("v-half-linear", "iii")]
    return _READING.format(
        half=ratios["half"],
        linear=ratios["linear"],
        both=ratios["half-linear"],
        over_iii=_ratio(changed["half-linear"], most_unmapped),
        way=ways[0] / ways[1],
    )


def _ratio(numerator: np.ndarray, denominator: np.ndarray) -> str:
    """A ratio of means with its interval."""
    return ratio_interval(numerator, denominator).text()
