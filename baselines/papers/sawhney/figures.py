"""Figs. 6, 8 and 10 of Sawhney 2009, and sect. 4.1, with ours."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from baselines.experiments.experiment import Records, sample
from baselines.experiments.plots import COLOURS, interval_line, mean_band
from baselines.papers.sawhney.claims import (
    ENDS,
    PAPER_ASYNCHRONOUS,
    PAPER_BEST_BETA,
    PAPER_BETA,
    PARTS,
    best_beta,
    betas_in,
    compared,
    relative,
    teams_in,
    worlds_in,
)
from baselines.papers.sawhney.sweep import cell_id


def figure_beta(records: Records, part: str) -> Figure:
    """Draw relative time over β, at three ends, and in each world to 95 %; V/t is 1."""
    betas = betas_in(records, part)
    figure = Figure(figsize=(9.6, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    lines: list[tuple[Any, tuple[str, ...], str, str]] = [(left, (), end, ENDS[end]) for end in ENDS]
    lines += [(right, (world,), "t95_s", world) for world in worlds_in(records, part)]
    for number, (axes, worlds, end, label) in enumerate(lines):
        samples = [relative(records, part, f"beta-{beta}", end, (), worlds) for beta in betas]
        style = {"color": COLOURS[number % len(COLOURS)], "marker": "o", "markersize": 3, "label": label}
        mean_band(axes, betas, np.stack(samples, axis=1), **style)
    paper = 1.0 / PAPER_BEST_BETA[part]
    left.plot([PAPER_BETA[part]], [paper], "*", color="w", markeredgecolor="k", markersize=12)
    place: Any = {"xytext": (4, 8), "textcoords": "offset points", "fontsize": 8}
    left.annotate("the paper's best β", (PAPER_BETA[part], paper), **place)
    for axes, title in ((left, "all worlds and team sizes"), (right, "to 95 %, by world")):
        axes.axhline(1.0, color="0.3", linewidth=0.9, linestyle="--")
        axes.set(xscale="log", xlabel="β in the paper's numbers (units: see the text)")
        axes.set_xticks(betas, [str(beta) for beta in betas], rotation=60, fontsize=8)
        axes.minorticks_off()
        axes.set_title(title, fontsize=9)
        axes.legend(frameon=False, fontsize=8)
    left.set_ylabel("time over that of V/t (dashed)")
    figure.suptitle(f"V - βt against V/t, {PARTS[part]}; means, 95 % intervals", fontsize=10)
    return figure


def figure_times(records: Records, part: str) -> Figure:
    """Draw seconds to 95 % over team size: V/t and every β (figs. 6, 8); synchronous and naive (4.1, 10)."""
    teams, worlds, betas = teams_in(records, part), worlds_in(records, part), betas_in(records, part)
    figure = Figure(figsize=(9.6, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    shades = colormaps["viridis_r"].resampled(len(betas) + 1)
    lines: list[tuple[Any, str, str, Any]] = [
        (left, f"beta-{beta}", f"β = {beta}", shades(number + 1)) for number, beta in enumerate(betas)
    ]
    lines += [(left, "ptv", "V/t", "k"), (right, "ptv", "V/t, asynchronous", "k")]
    lines += [(right, "sync", "V/t, synchronous", COLOURS[0]), (right, "naive", "naive V/t", COLOURS[1])]
    for axes, method, label, colour in lines:
        samples = [
            np.concatenate([sample(records, cell_id(w, n, method), "t95_s") for w in worlds]) for n in teams
        ]
        style = {"color": colour, "marker": "o", "markersize": 3, "label": label}
        if axes is right:
            mean_band(axes, teams, np.stack(samples, axis=1), **style)
        else:
            axes.plot(teams, [sample.mean() for sample in samples], linewidth=1 + (method == "ptv"), **style)
    for axes in (left, right):
        axes.set(xlabel="robots", xticks=teams)
        axes.legend(frameon=False, fontsize=7, ncols=2 if axes is left else 1)
    plans = part == "plans"
    left.set_ylabel("simulated seconds to 95 %")
    left.set_title(f"V - βt and V/t: fig. {6 if plans else 8}", fontsize=9)
    right.set_title(f"allocation and V: sect. 4.1{'' if plans else ' and fig. 10'}", fontsize=9)
    figure.suptitle(f"{PARTS[part]}: mean times over all worlds", fontsize=10)
    return figure


def figure_teams(records: Records, part: str) -> Figure:
    """Draw synchronous, naive and the rest over asynchronous V/t, by team size (sect. 4.1, fig. 10)."""
    teams, best = teams_in(records, part), best_beta(records, part, "t95_s")
    methods = {
        "sync": "synchronous",
        "naive": "naive V",
        f"beta-{best}": f"best β ({best})",
        "finish": "finishing rule",
        "nearest": "Yamauchi's metric",
        "coordinated": "Burgard's metric",
    }
    if part == "terrains":
        methods["no-height"] = "no height factor"
    figure = Figure(figsize=(9.6, 3.8), layout="constrained")
    panels = figure.subplots(1, len(ENDS), sharey=True)
    paper = 1.0 / PAPER_ASYNCHRONOUS[part]
    for axes, (end, text) in zip(panels, ENDS.items(), strict=True):
        for number, (method, label) in enumerate(methods.items()):
            points = [compared(records, part, method, "ptv", end, (n,)) for n in teams]
            shift = 0.06 * (number - 0.5 * (len(methods) - 1))
            style = {"color": COLOURS[number % len(COLOURS)], "markersize": 3, "capsize": 0, "label": label}
            interval_line(axes, [n + shift for n in teams], points, **style)
        axes.axhline(paper, color=COLOURS[0], linewidth=0.8, linestyle=":")
        axes.axhline(1.0, color="0.3", linewidth=0.9, linestyle="--")
        axes.set(xlabel="robots", xticks=teams, title=text)
    panels[0].set_ylabel("time over that of asynchronous V/t (dashed)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    dotted = f"dotted: the paper's synchronous allocation ({paper:.2f})"
    figure.suptitle(f"{PARTS[part]}, by team size; {dotted}", fontsize=10)
    return figure
