"""What figures share: colours and settings, lines through intervals, mean curves with bands, PNG files."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from baselines.experiments.statistics import Interval, mean_interval
from entropy_explore_env.reports.colours import robot_colour

COLOURS = tuple(tuple(level / 255 for level in robot_colour(robot)) for robot in range(8))
"""Of the robots, as in every other picture; colour-blind people can tell them apart."""
STYLE: Any = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
"""Of all figures: matplotlib's settings."""
DOTS_PER_INCH = 110
_PALETTE = 256
"""Colours of a PNG: files are a third as large, and look the same."""


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


def png(figure: Figure) -> bytes:
    """Return the figure as a PNG file, the same bytes for the same figure."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return packed_png(Image.open(drawn))


def packed_png(picture: Image.Image) -> bytes:
    """Return a picture as a PNG file of few colours."""
    packed = io.BytesIO()
    few = picture.convert("RGB").quantize(_PALETTE, dither=Image.Dither.NONE)
    few.save(packed, format="png", optimize=True)
    return packed.getvalue()
