"""The report on strategies over drift: Markdown with claims and tables, and a figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS, STYLE, png
from baselines.experiments.claims import Claim, claims_table
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.experiments.tables import markdown_table
from baselines.papers.sujan.drift.claims import (
    Records,
    blocked,
    error_m,
    half_times_s,
    joint,
    saw_half,
    times_s,
)
from baselines.papers.sujan.drift.sweep import (
    FIDUCIALS,
    LEVELS,
    MARGIN_M,
    PLAIN,
    SEEN_SHARE,
    STRATEGIES,
    cell_id,
)
from entropy_explore_env.writing import write_atomically

_HEAVY = "high"


def write_report(
    folder: Path, records: Records, claims: Sequence[Claim], command: str, limit_s: float
) -> Path:
    """Write `sujan-drift.md` and, in a folder `sujan-drift` beside it, its figure.

    Returns:
        Path of the report.
    """
    with mpl.rc_context(STYLE):
        write_atomically(folder / "sujan-drift" / "drift.png", png(figure_drift(records)))
    write_atomically(folder / "sujan-drift.md", _text(records, claims, command, limit_s))
    return folder / "sujan-drift.md"


_ABOUT = """\
Written by `{command}`: {worlds} worlds of `cluttered` (20 × 16 m, voxels of 0.1 m), one robot, until
{seen:.0%} of what can be seen was measured or {limit:.0f} s have passed. Many missions were cut off then,
as "ended" says: so claims about times are about the time to half of what can be seen, which nearly all
missions reach, and beside them stands what was seen in the end. A mission that did not see half counts with
all of its time; where these are more than one in twenty, no claim that half is seen soon holds.

High drift: the standard deviation of x, and that of y, grows by 0.02 m a √m, that of the yaw by 0.01 rad a
√m and a √rad; low drift: 0.3 times as much. {fiducials} landmarks on obstacles correct the estimate:
without any, single missions in an office came to a stop half-mapped even with low drift. Robots that drift
plan for a body {margin:g} m wider (`Localization.margin_m`), and back off from what blocked them
(`planner.back_off`); "plain" has neither. Wrong is the share of the measured voxels on the wrong side
of ½, of a map of all scans. Intervals are 95 % paired bootstrap intervals over worlds."""


def _text(records: Records, claims: Sequence[Claim], command: str, limit_s: float) -> str:
    about = _ABOUT.format(
        command=command,
        worlds=len(next(iter(records.values()))),
        seen=SEEN_SHARE,
        limit=limit_s,
        fiducials=FIDUCIALS,
        margin=MARGIN_M,
    )
    parts = [
        "# Strategies over drift",
        about,
        f"## Claims: {sum(claim.holds for claim in claims)} of {len(claims)} hold",
        "All are ours. A claim holds if the whole interval says so.",
        claims_table(claims, given="asked"),
        "## Strategies",
        _table(records, [(strategy, level, False) for strategy in STRATEGIES for level in LEVELS]),
        "![Map errors and times to half over drift](sujan-drift/drift.png)",
        "## Without margin and guard",
        _table(
            records,
            [
                (name, level, plain)
                for name in PLAIN
                for level in LEVELS
                if LEVELS[level]
                for plain in (True, False)
            ],
        ),
        "## Which of them suffers, and why",
        _reading(records),
    ]
    return "\n\n".join(parts) + "\n"


def _table(records: Records, cells: Sequence[tuple[str, str, bool]]) -> str:
    rows = []
    for strategy, level, plain in cells:
        cell = cell_id(strategy, level, plain)
        paper = f" ({STRATEGIES[strategy]})" if STRATEGIES[strategy] else ""
        rows.append(
            [
                f"{strategy}{paper}{', plain' if plain else ''}",
                level,
                mean_interval(half_times_s(records, cell)).text(".0f"),
                f"{saw_half(records, cell):.0%}",
                mean_interval(times_s(records, cell)).text(".0f"),
                f"{np.mean([record['finished'] for record in records[cell]]):.0%}",
                f"{joint(records, cell, 'explored').mean():.3f}",
                mean_interval(100.0 * joint(records, cell, "wrong")).text(),
                f"{error_m(records, cell).mean():.3f}",
                f"{_sightings(records, cell):.2f}",
                f"{blocked(records, cell).mean():.1f}",
                f"{max(record['most_blocked'] for record in records[cell])}",
            ]
        )
    head = [
        "strategy",
        "drift",
        "half seen (s)",
        "saw half",
        "mission time (s)",
        "ended",
        "share seen",
        "wrong (%)",
        "rms error (m)",
    ]
    return markdown_table([*head, "sighted a scan", "blocked", "most in a row"], rows)


def _sightings(records: Records, cell: str) -> float:
    sighted = sum(record.get("localization", {}).get("sightings", 0) for record in records[cell])
    return sighted / max(sum(record["scans"] for record in records[cell]), 1)


def _reading(records: Records) -> str:
    """Strategies from the one that suffers most, in numbers from the same records."""
    slower = {
        name: ratio_interval(*(half_times_s(records, cell_id(name, level)) for level in (_HEAVY, "none")))
        for name in STRATEGIES
    }
    lines = []
    for name in sorted(STRATEGIES, key=lambda name: -slower[name].value):
        cell, exact = cell_id(name, _HEAVY), cell_id(name, "none")
        scans, scans_before = (np.mean([record["scans"] for record in records[c]]) for c in (cell, exact))
        seen = [joint(records, each, "explored").mean() for each in (cell, exact)]
        wrong = [100.0 * joint(records, each, "wrong").mean() for each in (cell, exact)]
        way, way_before = (np.mean([record["distance_m"] for record in records[c]]) for c in (cell, exact))
        lines.append(
            f"- `{name}`: half is seen in {slower[name].text()} of its time without drift; {seen[0]:.3f} "
            f"seen in the end instead of {seen[1]:.3f}, {scans:.0f} scans instead of {scans_before:.0f}, "
            f"{way:.0f} m instead of {way_before:.0f} m, {blocked(records, cell).mean():.1f} drives blocked "
            f"instead of {blocked(records, exact).mean():.1f}, "
            f"{wrong[0]:.1f} % wrong instead of {wrong[1]:.1f} %."
        )
    return _CAUSES + "\n".join(lines)


_CAUSES = """\
Two causes were found by following single missions. A robot that is off by a fraction of a voxel drives
along walls that it believes to be a voxel away, is stopped there, and, since its pose is less certain now
than when it mapped the way as free, what it measures at the stop does not turn that belief: it tries again.
And strategies that count bits expect a scan to bring what an exact robot's would; where it brings less, they
scan the same place again and again. A margin and the guard are against the first, the guard also against the
second; the table above says what they save. With high drift, from the strategy that suffers most:

"""


def figure_drift(records: Records) -> Figure:
    """Wrong voxels and times to half of what can be seen, of every strategy over the level of drift."""
    figure = Figure(figsize=(9.5, 4.0), layout="constrained")
    wrongs, times = figure.subplots(1, 2)
    for number, strategy in enumerate(STRATEGIES):
        cells = [cell_id(strategy, level) for level in LEVELS]
        style = {
            "color": COLOURS[number % len(COLOURS)],
            "marker": "o",
            "linestyle": "solid" if number < len(COLOURS) else "dashed",
        }
        factors = list(LEVELS.values())
        wrongs.plot(factors, [100.0 * joint(records, cell, "wrong").mean() for cell in cells], **style)
        times.plot(factors, [half_times_s(records, cell).mean() for cell in cells], label=strategy, **style)
    wrongs.set(xlabel="drift over high drift", ylabel="voxels on the wrong side of ½ (%)", ylim=(0, None))
    times.set(xlabel="drift over high drift", ylabel="seconds to half of what can be seen", ylim=(0, None))
    figure.legend(*times.get_legend_handles_labels(), loc="outside right center", frameon=False)
    return figure
