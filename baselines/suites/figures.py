"""The figures of suites: each strategy's ratio by task, and degradation under faults."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.experiments.plots import COLOURS
from baselines.suites.faults import CONDITIONS, LOSSES, LOST_ISOLATED, NOTHING_FAILS, Times
from baselines.suites.results import Results

_CLIPPED, _LIGHT_ABOVE = 2.0, 1.3
"""Ends of the colour scale, and from where numbers are white; log2 of ratios."""


def task_figure(results: Results) -> Figure:
    """Draw a row per task and a column per strategy: the ratio to the reference as colour and number."""
    reference, measure = results.reference, results.suite.measures[0]
    strategies, tasks = results.ran, results.tasks
    ratios = np.array([[results.ratio_alone(name, task) for name in strategies] for task in tasks])
    figure = Figure(figsize=(0.55 * len(strategies) + 4.4, 0.24 * len(tasks) + 2.4), layout="constrained")
    axes = figure.subplots()
    shown = axes.imshow(np.log2(ratios), cmap="RdBu_r", vmin=-_CLIPPED, vmax=_CLIPPED, aspect="auto")
    for (row, column), ratio in np.ndenumerate(ratios):
        text = "-" if np.isnan(ratio) else f"{ratio:.2f}" if ratio < 9.95 else f"{ratio:.0f}"
        light = not np.isnan(ratio) and abs(np.log2(ratio)) > _LIGHT_ABOVE
        colour = "white" if light else "black"
        axes.text(column, row, text, ha="center", va="center", fontsize=7, color=colour)
    axes.set_xticks(range(len(strategies)), strategies, rotation=40, ha="right")
    axes.set_yticks(range(len(tasks)), [task.name for task in tasks])
    axes.tick_params(length=0)
    title = f"{measure.words[0].upper()}{measure.words[1:]} over that of {reference}"
    axes.set_title(title, loc="left")
    bar = figure.colorbar(shown, ax=axes, shrink=0.8, ticks=[-2, -1, 0, 1, 2])
    bar.ax.set_yticklabels(["¼", "½", "1", "2", "4"])
    return figure


def fault_figure(times: Times) -> Figure:
    """Draw a panel per team: mission time over that without faults; hollow points are lower bounds."""
    figure = Figure(figsize=(2.6 + 3.6 * len(times.teams), 5.0), layout="constrained")
    panels = figure.subplots(1, len(times.teams), squeeze=False, sharey=True)[0]
    names = [name for name in CONDITIONS if name != LOST_ISOLATED]
    for axes, team in zip(panels, times.teams, strict=True):
        for number, strategy in enumerate(times.strategies):
            _draw_strategy(axes, times, team, number, strategy, names)
        axes.set_title(f"{team[0]}, {team[1]} robots", fontsize=9)
        axes.axhline(1.0, color="0.6", linewidth=0.8)
        axes.set_xticks(
            range(len(names)), [name or "nothing fails" for name in names], rotation=40, ha="right"
        )
    panels[0].set_ylabel("mission time over that without faults")
    handles, labels = panels[0].get_legend_handles_labels()
    handles += panels[0].plot([], [], "o", markersize=3.5, color="0.3", markerfacecolor="white")
    labels.append("hollow: missions were cut off")
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def _draw_strategy(
    axes: Axes, times: Times, team: tuple[str, int], number: int, strategy: str, names: list[str]
) -> None:
    """Draw the points of a strategy with their intervals, those of lost messages joined by a line."""
    colour: Any = COLOURS[number % len(COLOURS)]
    shift = 0.09 * (number - 0.5 * (len(times.strategies) - 1))
    line = []
    for place, name in enumerate(names):
        ratio = times.ratio(*team, strategy, name, NOTHING_FAILS)
        if ratio is None:
            continue
        at = place + shift
        arms = [[max(ratio.value - ratio.low, 0.0)], [max(ratio.high - ratio.value, 0.0)]]
        axes.errorbar(at, ratio.value, arms, fmt="none", ecolor=colour, linewidth=0.8)
        hollow = times.cut_off(*team, strategy, name) > 0
        axes.plot(at, ratio.value, "o", markersize=3.5, color=colour, mfc="white" if hollow else colour)
        if place <= len(LOSSES):
            line.append((at, ratio.value))
    axes.plot(*zip(*line, strict=True), color=colour, linewidth=1.2, label=strategy) if line else None
