"""The report on errors of localization: Markdown with claims and tables, and figure 19."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS, STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.experiments.tables import csv_table, markdown_table
from baselines.papers.sujan.localization.claims import (
    EVERY_M,
    WAY_M,
    Records,
    at_end,
    errors_by_way,
    rms_error_m,
    time_to_map,
)
from baselines.papers.sujan.localization.sweep import (
    COUNTS,
    ERROR_WEIGHTS,
    OWN,
    OWN_ID,
    REACH_M,
    SPARSE,
    cell_id,
    in_world,
)
from entropy_explore_env.writing import write_atomically

_SHARE = 0.25
"""Of what can be seen: how long it takes to map it."""


def write_report(folder: Path, records: Records, claims: Sequence[Claim], command: str) -> Path:
    """Write `sujan-localization.md` and, in a folder `sujan-localization` beside it, figure 19.

    Returns:
        Path of the report.
    """
    beside = folder / "sujan-localization"
    with mpl.rc_context(STYLE):
        figure, table = figure_19(records)
        write_atomically(beside / "figure-19.png", png(figure))
    write_atomically(beside / "figure-19.csv", csv_table(table))
    write_atomically(folder / "sujan-localization.md", _text(records, claims, command))
    return folder / "sujan-localization.md"


_ABOUT = """\
Written by `{command}`: {worlds} worlds of `occlusions` (100 × 100 m), one mission of one robot (90°, 15 m)
by method (v) in each cell, all from the middle, {scans} scans. The robot drifts: the standard deviation of
x, and that of y, grows by 0.02 m a √m, that of the yaw by 0.002 rad a √m and a √rad. Its map is made of
what it believes; errors are against the truth. The paper gives no numbers for fig. 19, and tracks features
of the scene. Here fiducials are drawn on obstacles, their places are known, and a sighting has a standard
deviation of 0.05 m along and 0.01 rad aside. Near ones are sighted up to 7.5 m away, far ones up to 15 m;
so many are drawn that 1, 3 or 10 are in a circle of that radius on average ({numbers} in a world). A
quarter of them is in view, less what obstacles hide. "Own" are up to {own} landmarks that the robot chooses
in its own map, without any fiducials; sightings of those that it kept to the end are counted. Errors are
compared over the first {way:.0f} m of the way: rms in the tables is over the way of a mission, of which the
mean over worlds is shown; in the figure it is over worlds, at every place of the way. Intervals are 95 %
paired bootstrap intervals over worlds."""


_NEARNESS = """\
How near fiducials are sighted matters less than how often. With known places a sighting is off by 0.05 m, and
aside by 0.15 m at 15 m and half of that at 7.5 m; where few are in sight, what is added between two sightings
is several times as much. The paper tracks features whose own places are uncertain, the more so the farther
away."""


def _text(records: Records, claims: Sequence[Claim], command: str) -> str:
    cell = records[cell_id(0, "far")]
    numbers = "; ".join(
        f"{reach} " + ", ".join(str(in_world(count, reach)) for count in COUNTS[1:]) for reach in REACH_M
    )
    about = _ABOUT.format(
        command=command,
        worlds=len(cell),
        scans=len(cell[0]["mapped"]),
        numbers=numbers,
        own=OWN,
        way=WAY_M,
    )
    parts = [
        "# Sujan and Meggiolaro, errors of localization",
        about,
        f"## Claims: {sum(claim.holds for claim in claims)} of {len(claims)} hold",
        "A claim holds if the whole interval says so.",
        claims_table(claims),
        "## Errors over the way",
        _fiducials_table(records),
        "![Figure 19](sujan-localization/figure-19.png)",
        _NEARNESS,
        "## The localization error in the rating",
        _weights_table(records),
        _reading(records),
    ]
    return "\n\n".join(parts) + "\n"


def _fiducials_table(records: Records) -> str:
    cells = [("0", "", cell_id(0, "far")), ("own", "", OWN_ID)]
    cells += [(str(count), reach, cell_id(count, reach)) for reach in REACH_M for count in COUNTS if count]
    rows = []
    for count, reach, cell in cells:
        told = [record["localization"] for record in records[cell]]
        sighted = np.mean([each["sightings"] + each.get("own_sightings", 0) for each in told])
        scans = np.mean([record["scans"] for record in records[cell]])
        rows.append(
            [
                count,
                reach,
                f"{sighted / scans:.2f}",
                mean_interval(rms_error_m(records, cell)).text(".3f"),
                mean_interval(errors_by_way(records, cell)[:, -1]).text(".2f"),
                f"{at_end(records, cell, 'mapped').mean():.3f}",
                mean_interval(at_end(records, cell, "wrong")).text(".4f"),
            ]
        )
    head = ["within reach", "", "sighted a scan", f"rms over {WAY_M:.0f} m, mean of worlds (m)"]
    head.append(f"error after {WAY_M:.0f} m, mean of worlds (m)")
    return markdown_table([*head, "share mapped, mean", "wrong, mean"], rows)


def _weights_table(records: Records) -> str:
    rows = []
    for count in SPARSE:
        base = cell_id(count, "far")
        for weight in (0.0, *ERROR_WEIGHTS):
            cell = cell_id(count, "far", weight)
            times = time_to_map(records, cell, _SHARE)
            mapped = np.mean(at_end(records, cell, "mapped") >= _SHARE)
            rows.append(
                [
                    str(count),
                    f"{weight:g}",
                    mean_interval(rms_error_m(records, cell)).text(".3f"),
                    mean_interval(at_end(records, cell, "wrong")).text(".4f"),
                    f"{at_end(records, cell, 'mapped').mean():.3f}",
                    f"{at_end(records, cell, 'driven_m_by_scan').mean():,.0f}",
                    f"{times.mean():,.0f} ({mapped:.0%})",
                    "{:.2f} ({:.2f} … {:.2f})".format(
                        *ratio_interval(times, time_to_map(records, base, _SHARE))
                    ),
                ]
            )
    head = ["within reach", "w_LE", f"rms over {WAY_M:.0f} m, mean of worlds (m)", "wrong, mean"]
    head += ["share mapped, mean", "way, mean (m)"]
    return markdown_table(
        [*head, f"seconds to {_SHARE:.0%} mapped (who did)", "over w_LE 0"],
        rows,
    )


def _reading(records: Records) -> str:
    """What the tables say, in numbers from the same records."""
    lines = []
    for count in SPARSE:
        base = cell_id(count, "far")
        for weight in ERROR_WEIGHTS:
            cell = cell_id(count, "far", weight)
            error = ratio_interval(rms_error_m(records, cell), rms_error_m(records, base))
            wrong = ratio_interval(at_end(records, cell, "wrong"), at_end(records, base, "wrong"))
            mapped = ratio_interval(at_end(records, cell, "mapped"), at_end(records, base, "mapped"))
            lines.append(
                f"- {count} within reach, w_LE {weight:g}: {error.text()} of the error of the place and "
                f"{wrong.text()} of the wrong share, with {mapped.text()} mapped for the same scans."
            )
    return "\n".join(lines)


def figure_19(records: Records) -> tuple[Figure, dict[str, list[object]]]:
    """Root mean square error of the place over the way, near and far fiducials, with its numbers."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    table: dict[str, list[object]] = {"fiducials": [], "reach": [], "driven_m": [], "rms_error_m": []}
    for axes, reach in zip(figure.subplots(1, len(REACH_M), sharey=True), REACH_M, strict=True):
        for number, count in enumerate(COUNTS):
            curve = np.sqrt((errors_by_way(records, cell_id(count, reach)) ** 2).mean(axis=0))
            at = EVERY_M * np.arange(len(curve))
            axes.plot(at, curve, color=COLOURS[number], label=f"{count}")
            table["fiducials"] += [count] * len(curve)
            table["reach"] += [reach] * len(curve)
            table["driven_m"] += at.tolist()
            table["rms_error_m"] += curve.round(4).tolist()
        axes.set(title=f"{reach}: up to {REACH_M[reach]:g} m", xlabel="way (m)", ylim=(0, None))
    figure.axes[0].set_ylabel("error of the place, rms over worlds (m)")
    figure.axes[0].legend(frameon=False, title="fiducials within reach")
    return figure, table
