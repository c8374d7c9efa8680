"""Figures 20 and 22 of Sujan, each with the numbers that it shows."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS
from baselines.experiments.statistics import mean_interval
from baselines.papers.sujan.claims import Records, by_scan
from baselines.papers.sujan.sweep import METHODS, SCANS, cell_id

_EVERY = 5
"""Scans between the points of a table."""


def figure_scans(records: Records, robots: int) -> tuple[Figure, dict[str, list[object]]]:
    """Share mapped and way driven over scans, mean of all worlds with 95 % intervals."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    shares, ways = figure.subplots(1, 2)
    table: dict[str, list[object]] = {"method": [], "scans": []}
    for number, (method, strategy) in enumerate(METHODS.items()):
        cell = cell_id(robots, method)
        table["method"] += [strategy] * (SCANS // _EVERY + 1)
        table["scans"] += list(range(0, SCANS + 1, _EVERY))
        for axes, field, name in ((shares, "mapped", "mapped"), (ways, "driven_m_by_scan", "driven_m")):
            curve = _draw(axes, by_scan(records, cell, field), f"({method}) {strategy}", COLOURS[number])
            for column, values in zip(("mean", "low", "high"), curve, strict=True):
                table.setdefault(f"{name}_{column}", []).extend(values.tolist())
    shares.set(xlabel="scans of the team", ylabel="share mapped", ylim=(0, 1))
    ways.set(xlabel="scans of the team", ylabel="way of the team (m)", ylim=(0, None))
    ways.legend(frameon=False, loc="upper left")
    team = "one robot, 90°, 15 m" if robots == 1 else "two robots, 75°, 10 m"
    worlds = len(records[cell_id(robots, "v")])
    figure.suptitle(f"Fig. {20 if robots == 1 else 22}: {team}; means of {worlds} worlds")
    return figure, table


def _draw(
    axes: Axes, rows: np.ndarray, label: str, colour: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw the mean of (N, S + 1) rows with its interval; (mean, low, high) at every few scans."""
    at = np.arange(0, rows.shape[1], _EVERY)
    mean, low, high = (np.array(c) for c in zip(*(mean_interval(rows[:, n]) for n in at), strict=True))
    axes.plot(at, mean, color=colour, label=label)
    axes.fill_between(at, low, high, color=colour, alpha=0.18, linewidth=0)
    return mean.round(4), low.round(4), high.round(4)
