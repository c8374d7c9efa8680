"""Mission time in validations over robot-steps: a figure with a line for each run, and its table."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from baselines.cli.figures import COLOURS, STYLE, png
from baselines.experiments.tables import csv_table
from training.trainer_comparison import Run, by_trainer


def curves_png(runs: Sequence[Run]) -> bytes:
    """The figure, as a PNG file; runs of one trainer have one colour."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.4, 3.9), layout="constrained")
        axes = figure.subplots()
        for colour, (name, each) in zip(COLOURS, by_trainer(runs).items(), strict=False):
            for number, run in enumerate(each):
                steps = np.array([row.robot_steps for row in run.curve]) / 1e6
                times = [row.median_s for row in run.curve]
                label = name if number == 0 else None
                axes.plot(steps, times, color=colour, linewidth=1.4, marker=".", label=label)
        axes.set(yscale="log", xlabel="robot-steps, millions", ylabel="mission time, median, s")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_xlim(left=0.0)
        axes.grid(axis="y", color="0.9", linewidth=0.8)
        axes.legend(frameon=False)
    return png(figure)


def curves_csv(runs: Sequence[Run]) -> str:
    """The numbers of the figure."""
    rows = [(run.trainer, run.seed, *row) for run in runs for row in run.curve]
    names = ("trainer", "seed", "robot_steps", "mean_s", "median_s")
    return csv_table({name: [row[place] for row in rows] for place, name in enumerate(names)})
