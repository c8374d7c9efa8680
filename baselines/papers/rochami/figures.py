"""Figures 6 and 7 of RochaMI, and one of a steered I_min."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.experiments.experiment import Records, sample
from baselines.experiments.plots import COLOURS, interval_line, mean_band
from baselines.experiments.statistics import mean_interval
from baselines.papers.rochami.claims import (
    PAPER_COORDINATED,
    PAPER_REAL,
    PAPER_UNCOORDINATED,
    bits_sent,
    distances,
    teams_in,
)
from baselines.papers.rochami.sweep import (
    BLOCKED,
    FILLS,
    I_MINS,
    KAPPAS,
    METHODS,
    SHARING_TEAMS,
    cell_id,
    kappa_id,
    sharing_id,
)

_STYLES = {
    "coordinated": (COLOURS[0], "o", "-"),
    "uncoordinated": (COLOURS[1], "s", "-"),
    "random": ("0.55", "x", ":"),
}
_MARGIN = 1.12


def _line(axes: Axes, places: Sequence[float], samples: Sequence[np.ndarray], **style: object) -> None:
    """Draw means with their intervals as a band, and medians dashed."""
    mean_band(axes, places, np.stack(samples, axis=1), **style)
    axes.plot(places, [np.median(sample) for sample in samples], "--", color=style["color"], linewidth=0.8)


def figure_6(records: Records) -> Figure:
    """Draw mission time over team size: both methods and a random walk; blocked robots wait, or wander."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    panels, sizes = figure.subplots(1, 2, sharey=True), (1, *teams_in(records))
    one_s = sample(records, cell_id(1, "coordinated")).mean()
    for axes, blocked in zip(panels, BLOCKED, strict=True):
        for method in METHODS:
            samples = [sample(records, cell_id(n, method, blocked)) for n in sizes]
            colour, marker, line = _STYLES[method]
            label = "random walk" if method == "random" else method
            _line(axes, sizes, samples, color=colour, marker=marker, linestyle=line, label=label)
        if blocked == "wait":
            means = [sample(records, f"n{n}-random-1m").mean() for n in sizes]
            axes.plot(sizes, means, "+:", color="0.7", label="random walk, steps up to 1 m")
        star = {"markersize": 13, "markeredgecolor": "k"}
        axes.plot([2], [PAPER_COORDINATED * one_s], "*", color=COLOURS[0], **star)
        axes.plot([2], [PAPER_UNCOORDINATED * one_s], "*", color=COLOURS[1], **star)
        axes.plot([2], [PAPER_REAL * one_s], "D", color="w", markeredgecolor="k", markersize=5)
        axes.axhline(one_s, color="0.8", linewidth=0.8)
        axes.set(xlabel="robots", xticks=sizes, title=f"blocked robots {blocked}")
    panels[0].set(ylabel="mission time (s)", ylim=(0, None))
    panels[0].legend(frameon=False, fontsize=8)
    note = "★ the paper's ratios for 2 robots (0.59, 0.81)\n◇ its real run (0.72)\ntimes our one robot"
    place = {"transform": panels[1].transAxes, "ha": "right", "va": "top", "fontsize": 8}
    panels[1].text(0.98, 0.97, note, **place)
    figure.suptitle("Fig. 6: mean mission time with 95 % intervals; dashed: medians", fontsize=10)
    return figure


def figure_7(records: Records) -> Figure:
    """Draw two coordinated robots over κ: mission time and distance driven, and their product."""
    kappas = [kappa for kappa in KAPPAS if kappa_id(kappa) in records]
    figure = Figure(figsize=(6.4, 6.0), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    other = top.twinx()
    time_s = [sample(records, kappa_id(kappa)) for kappa in kappas]
    path_m = [distances(records, kappa_id(kappa)) for kappa in kappas]
    both = [t * d for t, d in zip(time_s, path_m, strict=True)]
    lines = ((time_s, top, COLOURS[0], "o"), (path_m, other, COLOURS[1], "s"), (both, bottom, "0.2", "^"))
    for samples, axes, colour, marker in lines:
        _line(axes, kappas, samples, color=colour, marker=marker)
        axes.set_ylim(0, _MARGIN * max(mean_interval(sample).high for sample in samples))
    top.set_ylabel("mission time (s)", color=COLOURS[0])
    other.set_ylabel("distance a robot (m)", color=COLOURS[1])
    other.spines["right"].set_visible(True)
    bottom.axvline(0.25, color="0.8", linewidth=0.8)
    bottom.set(xlabel="κ", ylabel="t · d (s m)")
    top.set_title("Fig. 7: two coordinated robots; means, 95 % intervals; dashed: medians", fontsize=10)
    return figure


def figure_sharing(records: Records) -> Figure:
    """Draw Rocha04's room: mission time over the bits that a team sends, with fixed and steered I_min."""
    teams = [n for n in SHARING_TEAMS if sharing_id(n, I_MINS[0]) in records]
    figure = Figure(figsize=(4.8 * len(teams), 4.0), layout="constrained")
    for axes, n in zip(figure.subplots(1, len(teams), squeeze=False)[0], teams, strict=True):
        fixed = {f"{i:g}": sharing_id(n, i) for i in I_MINS}
        steered = {f"{f:g}": sharing_id(n, fill=f) for f in FILLS if sharing_id(n, fill=f) in records}
        lines = (("fixed I_min", fixed, 1, ":"), ("steered, share of the burst", steered, 0, "-"))
        for label, cells, number, line in lines:
            sent = [float(bits_sent(records, cell).mean()) for cell in cells.values()]
            points = [mean_interval(sample(records, cell)) for cell in cells.values()]
            interval_line(axes, sent, points, linestyle=line, color=COLOURS[number], label=label)
            for text, x, point in zip(cells, sent, points, strict=True):
                place = {"xytext": (4, 5 - 15 * number), "textcoords": "offset points", "fontsize": 8}
                axes.annotate(text, (x, point.value), color=COLOURS[number], **place)
        axes.set(
            xlabel="bits sent by the team (Mbit)", ylabel="mission time (s)", title=f"{n} robots, burst 64"
        )
    figure.legend(
        *figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False
    )
    return figure
