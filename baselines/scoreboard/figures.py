"""Figures of a suite: how long each strategy takes, over the reference, with intervals; and profiles."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from baselines.cli.figures import COLOURS
from baselines.scoreboard.results import Measure, Results, Row

_INK = (0.1, 0.1, 0.1)


def ratio_figure(results: Results, rows: list[Row]) -> Figure:
    """A panel a measure: each strategy's ratio to the first reference over all tasks, best above."""
    reference = results.reference
    measures = results.judged_by
    figure = Figure(figsize=(4.6 * len(measures), 0.32 * len(rows) + 1.2), layout="constrained")
    panels = figure.subplots(1, len(measures), squeeze=False)[0]
    for measure, axes in zip(measures, panels, strict=True):
        name = f"{measure.name}_over_{reference}"
        known = sorted(
            (row for row in rows if row[name] is not None), key=lambda row: row[name], reverse=True
        )
        middle = np.asarray([row[name] for row in known])
        ends = np.asarray([[row[f"{name}_low"], row[f"{name}_high"]] for row in known]).reshape(-1, 2).T
        places = np.arange(len(known))
        for place, row in enumerate(known):
            best = row["strategy"] == known[-1]["strategy"]
            axes.plot(ends[:, place], [place, place], color=COLOURS[0] if best else "0.6", linewidth=2.2)
            axes.plot(middle[place], place, "o", color=COLOURS[0] if best else _INK, markersize=5)
        axes.axvline(1.0, color="0.7", linewidth=0.8, zorder=0)
        axes.set_yticks(places, [row["strategy"] for row in known])
        axes.set(xscale="log", title=measure.words, xlabel=f"over that of {reference}")
        _plain_ratios(axes)
        axes.grid(axis="x", color="0.92", linewidth=0.8)
        axes.tick_params(axis="y", length=0)
    return figure


def task_figure(results: Results) -> Figure:
    """A column a task: each strategy's ratio to the first reference, a colour a ratio, numbers within."""
    reference, measure = results.reference, results.judged_by[0]
    strategies = results.ran
    tasks = [task for task in results.suite.tasks if any(results.of(task, who) for who in strategies)]
    ratios = np.full((len(strategies), len(tasks)), np.nan)
    for row, strategy in enumerate(strategies):
        for column, task in enumerate(tasks):
            ended = [
                record.get("finished") for who in (strategy, reference) for record in results.of(task, who)
            ]
            if any(ended):
                ratio = results.ratio(strategy, reference, measure, [task])
                ratios[row, column] = np.nan if ratio is None else ratio.value
    figure = Figure(figsize=(0.62 * len(tasks) + 2.8, 0.3 * len(strategies) + 2.0), layout="constrained")
    axes = figure.subplots()
    shown = axes.imshow(np.log2(ratios), cmap="RdBu_r", vmin=-2, vmax=2, aspect="auto")
    for (row, column), ratio in np.ndenumerate(ratios):
        text = "-" if np.isnan(ratio) else f"{ratio:.2f}" if ratio < 9.95 else f"{ratio:.0f}"
        light = not np.isnan(ratio) and abs(np.log2(ratio)) > 1.3
        axes.text(
            column, row, text, ha="center", va="center", fontsize=7, color="white" if light else "black"
        )
    axes.set_xticks(range(len(tasks)), [task.name for task in tasks], rotation=40, ha="right")
    axes.set_yticks(range(len(strategies)), strategies)
    axes.tick_params(length=0)
    axes.set_title(f"{_sentence(measure)} over that of {reference}")
    bar = figure.colorbar(shown, ax=axes, shrink=0.8, ticks=[-2, -1, 0, 1, 2])
    bar.ax.set_yticklabels(["¼", "½", "1", "2", "4"])
    return figure


def _sentence(measure: Measure) -> str:
    return measure.words[0].upper() + measure.words[1:]


def _plain_ratios(axes: Axes) -> None:
    """Ticks on a logarithmic axis that say 0.5, 1, 2 and not powers of ten."""
    low, high = axes.get_xlim()
    low, high = max(low, 0.05), min(high, 64.0)
    ticks = [tick for tick in (0.25, 0.5, 0.7, 1, 1.5, 2, 3, 5, 10, 20, 50) if low <= tick <= high]
    axes.set_xticks(ticks)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
