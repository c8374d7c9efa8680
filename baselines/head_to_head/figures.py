"""Figures of a head-to-head: performance profiles, and mission times with their intervals."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from baselines.cli.figures import COLOURS
from baselines.head_to_head.cells import BASELINE
from baselines.head_to_head.rows import Results, Row

_INK = ((0.0, 0.0, 0.0), *(COLOURS[place] for place in (5, 3, 2, 0, 4, 1)))
"""Colours of the strategies by place; black is the baseline's. Yellow and grey are too pale for lines."""
_LINES = ("-", "--", ":")
_MARKS = "oDs^vPX"
_THRESHOLDS = 2.0 ** (np.arange(-6 * 24, 4 * 24 + 1) / 24)
"""Multiples of the random walk's time."""


def profile_figure(results: Results) -> tuple[Figure, list[Row]]:
    """Share of missions mapped within a multiple of the random walk's time; a panel a team size."""
    teams = results.entries.robots
    across = len(teams) if len(teams) < 4 else math.ceil(len(teams) / 2)
    down = math.ceil(len(teams) / across)
    figure = Figure(figsize=(3.4 * max(across, 2) + 0.6, 3.1 * down + 0.6), layout="constrained")
    panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel()
    table: list[Row] = []
    for robots, axes in zip(teams, panels, strict=False):
        for place, strategy in enumerate(results.entries.strategies):
            share, low, high = results.profile(robots, strategy, _THRESHOLDS)
            colour, line = _look(place)
            axes.fill_between(_THRESHOLDS, low, high, step="post", color=colour, alpha=0.12, linewidth=0)
            axes.step(_THRESHOLDS, share, line, where="post", color=colour, linewidth=1.6, label=strategy)
            columns = zip(_THRESHOLDS.tolist(), share.tolist(), low.tolist(), high.tolist(), strict=True)
            names = ("multiple", "share", "low", "high")
            table += [
                {"robots": robots, "strategy": strategy, **dict(zip(names, row, strict=True))}
                for row in columns
            ]
        axes.axvline(1.0, color="0.7", linewidth=0.8, zorder=0)
        axes.set(xscale="log", ylim=(-0.02, 1.02), title=_team(robots))
        axes.set_xticks([1 / 64, 1 / 16, 1 / 4, 1, 4, 16], ["1/64", "1/16", "1/4", "1", "4", "16"])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.tick_params(labelbottom=True)  # also where no panel stands below
        axes.grid(axis="y", color="0.9", linewidth=0.8)
    _hide(panels[len(teams) :])
    figure.supxlabel(f"mission time over that of {BASELINE} with the same seed", fontsize=9)
    figure.supylabel("share of missions mapped", fontsize=9)
    _legend(figure, panels[0])
    return figure, table


def time_figure(results: Results, rows: list[Row]) -> Figure:
    """Mission times in seconds with their intervals: a panel a scenario, logarithmic, team sizes beside."""
    scenarios, strategies = list(results.entries.scenarios), results.entries.strategies
    across = min(len(scenarios), 2)
    down = math.ceil(len(scenarios) / across)
    figure = Figure(figsize=(4.9 * across, 2.7 * down + 0.6), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    teams = results.entries.robots
    apart = 0.8 / len(strategies)
    for name, axes in zip(scenarios, panels, strict=False):
        limit_s = results.entries.scenarios[name].ending.time_limit_s
        lowest_s = min(row["time_s_low"] for row in rows if row["scenario"] == name)
        axes.set_ylim(lowest_s / 1.4, limit_s * 1.4)
        axes.set_yscale("log")
        for place, strategy in enumerate(strategies):
            found = [row for row in rows if (row["scenario"], row["strategy"]) == (name, strategy)]
            middle = np.asarray([row["time_s"] for row in found])
            ends = np.asarray([[row["time_s_low"], row["time_s_high"]] for row in found]).T
            at = np.arange(len(teams)) + apart * (place - (len(strategies) - 1) / 2)
            colour, _ = _look(place)
            axes.errorbar(
                at,
                middle,
                np.abs(ends - middle),
                fmt=_MARKS[place % len(_MARKS)],
                color=colour,
                markersize=5,
                capsize=2.5,
                linewidth=1.4,
                label=strategy,
            )
        axes.axhline(limit_s, color="0.5", linestyle="--", linewidth=1, zorder=0)
        axes.set(title=name, xlim=(-0.5, len(teams) - 0.5))
        axes.set_xticks(range(len(teams)), [_team(robots) for robots in teams])
        axes.tick_params(axis="x", length=0)
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.grid(axis="y", color="0.92", linewidth=0.8)
        for border in np.arange(len(teams) - 1) + 0.5:
            axes.axvline(border, color="0.9", linewidth=0.8)
    _hide(panels[len(scenarios) :])
    figure.supylabel("mission time (s); dashed: the time limit", fontsize=9)
    _legend(figure, panels[0])
    return figure


def _team(robots: int) -> str:
    return f"{robots} robot" + ("s" if robots > 1 else "")


def _look(place: int) -> tuple[tuple[float, ...], str]:
    """Colour and line of the strategy at a place; after seven the colours come again, broken."""
    return _INK[place % len(_INK)], _LINES[place // len(_INK) % len(_LINES)]


def _hide(panels: np.ndarray) -> None:
    for axes in panels:
        axes.set_visible(False)


def _legend(figure: Figure, axes: Axes) -> None:
    """What the colours mean, once for all panels."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 5), frameon=False)
