"""The figures of the page: degradation by lost messages, and by all else that fails."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS
from baselines.experiments.statistics import Interval
from baselines.resilience.claims import slowdown
from baselines.resilience.sweep import (
    ISOLATED,
    LOSSES,
    LOST,
    TEXTS,
    Experiment,
    Records,
    loss_name,
)

Table = dict[str, list[object]]
OTHERS = ("burst-0", "range", "sight", LOST, ISOLATED)
"""Conditions of the second figure."""


def loss_figure(experiment: Experiment, records: Records) -> tuple[Figure, Table]:
    """Mission time over that without loss, by the share of messages that are lost; isolation at the end."""
    teams = experiment.teams()
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
            axes.errorbar(
                places + shift, values, _arms(found), fmt="o", color=colour, markersize=3, linewidth=0.8
            )
            for name, each in zip(points, found, strict=True):
                _note(table, scenario, robots, strategy, name, each)
        _by_loss(axes, f"{scenario}, {robots} robots")
    panels[0].set_ylabel("mission time over that without faults")
    handles, labels = panels[0].get_legend_handles_labels()
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
    strategies, teams = experiment.strategies, experiment.teams()
    height = 1.4 + 0.2 * len(strategies) * len(teams)
    figure = Figure(figsize=(11.0, height), layout="constrained")
    panels = figure.subplots(1, len(OTHERS), sharey=True)
    table: Table = {name: [] for name in _COLUMNS}
    rows = np.arange(len(strategies))[::-1].astype(float)
    for axes, name in zip(panels, OTHERS, strict=True):
        for place, (scenario, robots) in enumerate(teams):
            found = [slowdown(records, scenario, robots, strategy, name) for strategy in strategies]
            shift = 0.7 * ((place + 0.5) / len(teams) - 0.5)
            values = [each.value for each in found]
            axes.errorbar(
                values,
                rows - shift,
                xerr=_arms(found),
                fmt="o",
                color=COLOURS[place % len(COLOURS)],
                markersize=3.5,
                linewidth=1.0,
                label=f"{scenario}, {robots} robots",
            )
            for strategy, each in zip(strategies, found, strict=True):
                _note(table, scenario, robots, strategy, name, each)
        axes.axvline(1.0, color="0.6", linewidth=0.8)
        axes.set_title(TEXTS[name], fontsize=9)
        axes.set_yticks(rows, strategies)
        axes.set_ylim(-0.6, len(strategies) - 0.4)
    panels[len(OTHERS) // 2].set_xlabel("mission time over that without faults")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(teams), frameon=False, fontsize=8)
    return figure, table


_COLUMNS = ("scenario", "robots", "strategy", "condition", "ratio", "low", "high")


def _arms(found: Sequence[Interval]) -> np.ndarray:
    """(2, N) lengths of error bars."""
    down = [max(each.value - each.low, 0.0) for each in found]
    up = [max(each.high - each.value, 0.0) for each in found]
    return np.array([down, up])


def _note(table: Table, scenario: str, robots: int, strategy: str, name: str, found: Interval) -> None:
    row = (scenario, robots, strategy, name, *(f"{value:.4g}" for value in found))
    for column, value in zip(_COLUMNS, row, strict=True):
        table[column].append(value)
