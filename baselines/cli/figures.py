"""What figures share: the colours of robots, matplotlib's settings, the bytes of a PNG."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.figure import Figure

from entropy_explore_env.reports.colours import robot_colour
from entropy_explore_env.settings import Grid

COLOURS = tuple(tuple(level / 255 for level in robot_colour(robot)) for robot in range(8))
"""Of the robots, as in every other picture; colour-blind people can tell them apart."""


STYLE: Any = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
"""Of all figures: matplotlib's settings."""


def png(figure: Figure, dots_per_inch: int = 110) -> bytes:
    """The figure as the bytes of a PNG file, the same bytes for the same figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dots_per_inch, metadata={"Software": None})
    return buffer.getvalue()


def extent_of(grid: Grid) -> tuple[float, float, float, float]:
    """A workspace from above, in metres, as matplotlib's `imshow` wants it: left, right, bottom, top."""
    low, size = grid.origin_m, grid.size_m
    return float(low[0]), float(low[0] + size[0]), float(low[1]), float(low[1] + size[1])
