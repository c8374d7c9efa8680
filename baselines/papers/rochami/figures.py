"""Figures 6 and 7 of RochaMI, and three that it lacks, each with the numbers that it shows."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS
from baselines.experiments.statistics import mean_interval, median_interval, ratio_interval
from baselines.papers.rochami.claims import (
    PAPER_COORDINATED,
    PAPER_REAL,
    PAPER_UNCOORDINATED,
    Records,
    bits_sent,
    distances,
    teams_in,
    times,
)
from baselines.papers.rochami.sweep import (
    BLOCKED,
    CHANGES,
    COVERED,
    FEW,
    FILLS,
    I_MINS,
    KAPPAS,
    METHODS,
    SHARING_TEAMS,
    cell_id,
    change_id,
    kappa_id,
    sharing_id,
)

Table = dict[str, list[object]]

_STYLES = {
    "coordinated": (COLOURS[0], "o", "-"),
    "uncoordinated": (COLOURS[1], "s", "-"),
    "random": ("0.55", "x", ":"),
}
_MARGIN = 1.12


def figure_6(records: Records) -> tuple[Figure, Table]:
    """Mission time over team size: both methods and a random walk; blocked robots wait, or wander."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    sizes = (1, *teams_in(records))
    table: Table = {
        name: [] for name in ("blocked", "method", "robots", "mean_s", "low_s", "high_s", "median_s")
    }
    one_s = times(records, cell_id(1, "coordinated")).mean()
    for axes, blocked in zip(panels, BLOCKED, strict=True):
        for method in METHODS:
            samples = [times(records, cell_id(n, method, blocked)) for n in sizes]
            _band(axes, sizes, samples, method, method if method != "random" else "random walk")
            for n, sample in zip(sizes, samples, strict=True):
                _add(table, blocked=blocked, method=method, robots=n, **_numbers(sample))
        if blocked == "wait":
            samples = [times(records, f"n{n}-random-1m") for n in sizes]
            axes.plot(
                sizes, [s.mean() for s in samples], "+:", color="0.7", label="random walk, steps up to 1 m"
            )
            for n, sample in zip(sizes, samples, strict=True):
                _add(table, blocked=blocked, method="random-1m", robots=n, **_numbers(sample))
        axes.plot([2], [PAPER_COORDINATED * one_s], "*", color=COLOURS[0], markersize=13, markeredgecolor="k")
        axes.plot(
            [2], [PAPER_UNCOORDINATED * one_s], "*", color=COLOURS[1], markersize=13, markeredgecolor="k"
        )
        axes.plot([2], [PAPER_REAL * one_s], "D", color="w", markeredgecolor="k", markersize=5)
        axes.axhline(one_s, color="0.8", linewidth=0.8)
        axes.set(xlabel="robots", xticks=sizes, ylim=(0, None), title=f"blocked robots {blocked}")
    panels[0].set_ylabel("mission time (s)")
    panels[0].legend(frameon=False, fontsize=8)
    note = "★ the paper's ratios for 2 robots (0.59, 0.81), ◇ its real run (0.72), times our one robot"
    panels[1].text(
        0.98,
        0.97,
        note.replace(", ◇", "\n◇").replace(", times", "\ntimes"),
        transform=panels[1].transAxes,
        ha="right",
        va="top",
        fontsize=8,
    )
    figure.suptitle("Fig. 6: mean mission time with 95 % intervals; dashed: medians", fontsize=10)
    return figure, table


def _numbers(sample: np.ndarray) -> dict[str, float]:
    mean, low, high = mean_interval(sample)
    values = {"mean_s": mean, "low_s": low, "high_s": high, "median_s": float(np.median(sample))}
    return {name: round(value, 2) for name, value in values.items()}


def _add(table: Table, **row: object) -> None:
    for name, value in row.items():
        table[name].append(value)


def _band(axes: Axes, x: tuple[int, ...], samples: list[np.ndarray], method: str, label: str) -> None:
    """Means with their intervals as a band, and medians dashed."""
    colour, marker, line = _STYLES[method]
    mean, low, high = (np.asarray(column) for column in zip(*map(mean_interval, samples), strict=True))
    axes.plot(x, mean, line, marker=marker, color=colour, label=label)
    axes.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(x, [np.median(s) for s in samples], "--", color=colour, linewidth=0.8)


def figure_7(records: Records) -> tuple[Figure, Table]:
    """Two coordinated robots over κ: mission time and distance driven, and their product."""
    kappas = [kappa for kappa in KAPPAS if kappa_id(kappa) in records]
    figure = Figure(figsize=(6.4, 6.0), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    other = top.twinx()
    table: Table = {"kappa": list(kappas)}
    series = {
        "t_s": [times(records, kappa_id(kappa)) for kappa in kappas],
        "d_m": [distances(records, kappa_id(kappa)) for kappa in kappas],
    }
    series["t_d_s_m"] = [t * d for t, d in zip(series["t_s"], series["d_m"], strict=True)]
    for (name, samples), axes, colour, marker in zip(
        series.items(), (top, other, bottom), (COLOURS[0], COLOURS[1], "0.2"), "os^", strict=True
    ):
        mean, low, high = (np.asarray(c) for c in zip(*map(mean_interval, samples), strict=True))
        axes.plot(kappas, mean, marker=marker, color=colour)
        axes.fill_between(kappas, low, high, color=colour, alpha=0.2, linewidth=0)
        axes.plot(kappas, [np.median(s) for s in samples], "--", color=colour, linewidth=0.8)
        axes.set_ylim(0, _MARGIN * float(high.max()))
        for column, values in (("mean", mean), ("low", low), ("high", high)):
            table[f"{name}_{column}"] = values.round(2).tolist()
    top.set_ylabel("mission time (s)", color=COLOURS[0])
    other.set_ylabel("distance a robot (m)", color=COLOURS[1])
    other.spines["right"].set_visible(True)
    bottom.axvline(0.25, color="0.8", linewidth=0.8)
    bottom.set(xlabel="κ", ylabel="t · d (s m)")
    top.set_title("Fig. 7: two coordinated robots; means, 95 % intervals; dashed: medians", fontsize=10)
    return figure, table


def figure_coverage(records: Records) -> tuple[Figure, Table]:
    """H(T) and I along the mission, for both methods: means over missions; those that ended keep 0."""
    sizes = [n for n in COVERED if "coverage" in records[cell_id(n, "coordinated")][0]]
    figure = Figure(figsize=(9.6, 6.0), layout="constrained")
    panels = np.atleast_2d(figure.subplots(2, len(sizes), sharex="col", squeeze=False))
    table: Table = {name: [] for name in ("robots", "method", "time_s", "team_bits", "shared_bits")}
    for column, n in enumerate(sizes):
        last_s = max(float(np.median(times(records, cell_id(n, m)))) for m in METHODS[:2])
        grid = np.linspace(0.0, last_s, 60)
        for method in METHODS[:2]:
            found = [record["coverage"] for record in records[cell_id(n, method)]]
            for row, (name, title) in enumerate((("team_bits", "H(T)"), ("shared_bits", "I"))):
                curves = np.stack([np.interp(grid, c["time_s"], c[name], right=0.0) for c in found]) / 1000
                axes, colour = panels[row, column], _STYLES[method][0]
                axes.plot(grid, curves.mean(axis=0), color=colour, label=method)
                error = 1.96 * curves.std(axis=0, ddof=1) / np.sqrt(len(curves))
                mean = curves.mean(axis=0)
                axes.fill_between(
                    grid, np.maximum(mean - error, 0.0), mean + error, color=colour, alpha=0.2, linewidth=0
                )
                axes.set_ylabel(f"{title} (1000 bits)")
                if row == 0:
                    axes.set_title(f"{n} robots", fontsize=10)
                    table["robots"] += [n] * len(grid)
                    table["method"] += [method] * len(grid)
                    table["time_s"] += grid.round(2).tolist()
                table[name] += (1000 * mean).round(1).tolist()
        panels[1, column].set_xlabel("simulated time (s)")
    panels[0, 0].legend(frameon=False)
    figure.suptitle("What the team's cones cover, H(T), and what they cover more than once, I", fontsize=10)
    return figure, table


def figure_changes(records: Records) -> tuple[Figure, Table]:
    """Coordinated over uncoordinated time with one thing changed at a time."""
    names = [name for name in CHANGES if change_id(name, FEW[0], "coordinated") in records]
    figure = Figure(figsize=(9.6, 0.34 * len(names) + 1.8), layout="constrained")
    axes = figure.subplots()
    table: Table = {name: [] for name in ("change", "robots", "ratio", "low", "high")}
    rows = [("as it is", None), *((CHANGES[name].text, name) for name in names)]
    for row, (_, name) in enumerate(rows):
        for number, n in enumerate(FEW):
            cells = [cell_id(n, m) if name is None else change_id(name, n, m) for m in METHODS[:2]]
            starts = min(len(records[cell]) for cell in cells)
            ratio, low, high = ratio_interval(*(times(records, cell)[:starts] for cell in cells))
            y = row + 0.2 * (number - 1)
            axes.plot([low, high], [y, y], color=COLOURS[number], linewidth=1.5)
            label = f"{n} robots" if row == 0 else None
            axes.plot([ratio], [y], "o", color=COLOURS[number], markersize=4, label=label)
            _add(
                table,
                change=name or "-",
                robots=n,
                ratio=round(ratio, 3),
                low=round(low, 3),
                high=round(high, 3),
            )
    axes.axvline(1.0, color="0.6", linewidth=0.8)
    axes.set_yticks(range(len(rows)), [text for text, _ in rows], fontsize=8)
    axes.invert_yaxis()
    axes.set(xlabel="coordinated over uncoordinated mission time (mean, 95 % interval)")
    axes.set_title("One thing changed at a time; blocked robots wait", fontsize=10)
    axes.legend(frameon=False, fontsize=8, loc="best")
    return figure, table


def figure_sharing(records: Records) -> tuple[Figure, Table]:
    """Rocha04's room: mission time over the bits that a team sends, with fixed and steered I_min."""
    teams = [n for n in SHARING_TEAMS if sharing_id(n, I_MINS[0]) in records]
    figure = Figure(figsize=(4.8 * len(teams), 4.0), layout="constrained")
    panels = figure.subplots(1, len(teams), squeeze=False)[0]
    table: Table = {name: [] for name in ("robots", "i_min", "sent_mbit", "mean_s", "low_s", "high_s")}
    for axes, n in zip(panels, teams, strict=True):
        fills = [fill for fill in FILLS if sharing_id(n, fill=fill) in records]
        lines = (
            ("fixed I_min", [(f"{i:g}", sharing_id(n, i)) for i in I_MINS], COLOURS[1], "s:"),
            (
                "steered, share of the burst",
                [(f"{f:g}", sharing_id(n, fill=f)) for f in fills],
                COLOURS[0],
                "o-",
            ),
        )
        for label, points, colour, style in lines:
            sent = [bits_sent(records, cell).mean() for _, cell in points]
            mean, low, high = (
                np.asarray(c)
                for c in zip(*(mean_interval(times(records, cell)) for _, cell in points), strict=True)
            )
            axes.errorbar(
                sent, mean, [mean - low, high - mean], fmt=style, color=colour, capsize=3, label=label
            )
            for (text, _), x, y, below, above in zip(points, sent, mean, low, high, strict=True):
                axes.annotate(
                    text, (x, y), textcoords="offset points", xytext=(4, 5), fontsize=8, color=colour
                )
                kind = text if label.startswith("fixed") else f"steered-{text}"
                numbers = {"mean_s": y, "low_s": below, "high_s": above}
                rounded = {name: round(float(value), 2) for name, value in numbers.items()}
                _add(table, robots=n, i_min=kind, sent_mbit=round(float(x), 4), **rounded)
        axes.set(
            xlabel="bits sent by the team (Mbit)", ylabel="mission time (s)", title=f"{n} robots, burst 64"
        )
        axes.legend(frameon=False, fontsize=8)
    return figure, table


def median_text(sample: np.ndarray) -> str:
    """Median with its interval."""
    return "{:,.0f} ({:,.0f} … {:,.0f})".format(*median_interval(sample))
