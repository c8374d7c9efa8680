"""What figures of experiments share: lines through intervals, and mean curves with bands."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.experiments.statistics import Interval, mean_interval


def one_axes(**labels: Any) -> tuple[Figure, Axes]:  # noqa: ANN401 - what `Axes.set` takes
    """Return a figure of one pair of axes, with labels and limits."""
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.subplots()
    axes.set(**labels)
    return figure, axes


def interval_line(
    axes: Axes,
    places: Sequence[float] | np.ndarray,
    intervals: Iterable[Interval],
    **style: Any,  # noqa: ANN401
) -> None:
    """Draw a line through figures, with their intervals as bars."""
    value, low, high = np.array(list(intervals), float).T
    bars = [np.maximum(value - low, 0.0), np.maximum(high - value, 0.0)]
    axes.errorbar(places, value, bars, **{"marker": "o", "capsize": 3, **style})


def mean_band(
    axes: Axes,
    places: Sequence[float] | np.ndarray,
    samples: np.ndarray,
    **style: Any,  # noqa: ANN401
) -> None:
    """Draw the mean of (N, K) samples over K places, with its interval as a band."""
    value, low, high = np.array([mean_interval(column) for column in np.asarray(samples).T]).T
    (line,) = axes.plot(places, value, **style)
    axes.fill_between(places, low, high, color=line.get_color(), alpha=0.18, linewidth=0)
