"""The figures of the page: degradation by lost messages, and by all else that fails.

A point is hollow where missions were cut off: the ratio is at least so large.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from baselines.cli.figures import COLOURS
from baselines.experiments.statistics import Interval
from baselines.resilience.claims import missions_cut_off, slowdown
from baselines.resilience.sweep import (
    ISOLATED,
    LOSSES,
    LOST,
    TEXTS,
    Experiment,
    Records,
    cell_id,
    loss_name,
)

Table = dict[str, list[object]]
Colour = tuple[float, ...]
OTHERS = ("burst-0", "range", "sight", LOST, ISOLATED)
"""Conditions of the second figure."""


def loss_figure(experiment: Experiment, records: Records) -> tuple[Figure, Table]:
    """Mission time over that without loss, by the share of messages that are lost; isolation at the end."""
    teams = experiment.teams
    figure = Figure(figsize=(2.6 + 3.4 * len(teams), 4.6), layout="constrained")
    panels = figure.subplots(1, len(teams), squeeze=False, sharey=True)[0]
    table: Table = {name: [] for name in _COLUMNS}
    points = [*(loss_name(loss) for loss in LOSSES), ISOLATED]
    places = np.array([*LOSSES, 1.1])
    for axes, (scenario, robots) in zip(panels, teams, strict=True):
        for number, strategy in enumerate(experiment.strategies):
            found = [slowdown(records, scenario, robots, strategy, name) for name in points]
            shift = 0.008 * (number - 0.5 * (len(experiment.strategies) - 1))
            style = "-" if number < len(COLOURS) else "--"
            colour = COLOURS[number % len(COLOURS)]
            values = np.array([each.value for each in found])
            axes.plot(places[:-1] + shift, values[:-1], style, color=colour, linewidth=1.3, label=strategy)
            cut = [missions_cut_off(records, cell_id(scenario, robots, strategy, name)) for name in points]
            axes.errorbar(places + shift, values, _arms(found), fmt="none", ecolor=colour, linewidth=0.8)
            _dots(axes, places + shift, values, cut, colour)
            for name, each, number_cut in zip(points, found, cut, strict=True):
                _note(table, scenario, robots, strategy, name, each, number_cut)
        _by_loss(axes, f"{scenario}, {robots} robots")
    panels[0].set_ylabel("mission time over that without faults")
    handles, labels = panels[0].get_legend_handles_labels()
    handles.append(_hollow(axes=panels[0]))
    labels.append("hollow: missions were cut off")
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure, table


def _by_loss(axes: Axes, title: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("messages lost")
    axes.axhline(1.0, color="0.6", linewidth=0.8)
    axes.axvspan(1.0, 1.2, color="0.94", zorder=0)
    axes.set_xticks([*LOSSES, 1.1], [*(f"{loss:.0%}" for loss in LOSSES), "isolated"], fontsize=8)
    axes.set_xlim(-0.06, 1.2)


def fault_figure(experiment: Experiment, records: Records) -> tuple[Figure, Table]:
    """Mission time over that without faults: a row for each strategy, a panel for each fault."""
    strategies, teams = experiment.strategies, experiment.teams
    height = 1.4 + 0.2 * len(strategies) * len(teams)
    figure = Figure(figsize=(11.0, height), layout="constrained")
    panels = figure.subplots(1, len(OTHERS), sharex=True, sharey=True)
    table: Table = {name: [] for name in _COLUMNS}
    rows = np.arange(len(strategies))[::-1].astype(float)
    for axes, name in zip(panels, OTHERS, strict=True):
        for place, (scenario, robots) in enumerate(teams):
            found = [slowdown(records, scenario, robots, strategy, name) for strategy in strategies]
            shift = 0.7 * ((place + 0.5) / len(teams) - 0.5)
            values, colour = np.array([each.value for each in found]), COLOURS[place % len(COLOURS)]
            cut = [missions_cut_off(records, cell_id(scenario, robots, who, name)) for who in strategies]
            label = f"{scenario}, {robots} robots"
            arms = {"xerr": _arms(found), "fmt": "none", "ecolor": colour, "linewidth": 1.0}
            axes.errorbar(values, rows - shift, **arms)
            _dots(axes, values, rows - shift, cut, colour, label)
            for strategy, each, number_cut in zip(strategies, found, cut, strict=True):
                _note(table, scenario, robots, strategy, name, each, number_cut)
        axes.axvline(1.0, color="0.6", linewidth=0.8)
        axes.set_title(TEXTS[name], fontsize=9)
        axes.set_yticks(rows, strategies)
        axes.set_ylim(-0.6, len(strategies) - 0.4)
    panels[len(OTHERS) // 2].set_xlabel("mission time over that without faults")
    handles, labels = panels[0].get_legend_handles_labels()
    handles.append(_hollow(axes=panels[0]))
    labels.append("hollow: missions were cut off")
    columns = len(teams) + 1
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)
    return figure, table


_COLUMNS = ("scenario", "robots", "strategy", "condition", "ratio", "low", "high", "cut_off")


def _dots(
    axes: Axes, x: np.ndarray, y: np.ndarray, cut: Sequence[int], colour: Colour, label: str = ""
) -> None:
    """Points, hollow where missions were cut off."""
    for number, hollow in enumerate(cut):
        face = "white" if hollow else colour
        axes.plot(x[number], y[number], "o", markersize=3.5, color=colour, markerfacecolor=face)
    if label:
        axes.plot([], [], "o", markersize=3.5, color=colour, label=label)


def _hollow(axes: Axes) -> Line2D:
    """What stands for a hollow point in a legend."""
    return axes.plot([], [], "o", markersize=3.5, color="0.3", markerfacecolor="white")[0]


def _arms(found: Sequence[Interval]) -> np.ndarray:
    """(2, N) lengths of error bars."""
    down = [max(each.value - each.low, 0.0) for each in found]
    up = [max(each.high - each.value, 0.0) for each in found]
    return np.array([down, up])


def _note(
    table: Table, scenario: str, robots: int, strategy: str, name: str, found: Interval, cut: int
) -> None:
    row = (scenario, robots, strategy, name, *(f"{value:.4g}" for value in found), cut)
    for column, value in zip(_COLUMNS, row, strict=True):
        table[column].append(value)
