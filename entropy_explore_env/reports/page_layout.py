"""Where everything lies in a picture of a mission, arranged so that the maps become as large as they can."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from PIL import Image, ImageDraw

from entropy_explore_env.picture_text import text_width
from entropy_explore_env.reports.annotations import (
    LINE_HEIGHT,
    TEXT_SIZE,
    Box,
    Mark,
    draw_axes,
    draw_key,
    draw_legend,
    legend_rows,
    outline,
    write,
)
from entropy_explore_env.reports.colours import PAPER

MARGIN, HEADER = 8, 32
"""In units: edge of the picture, height of the title."""
_GAP, _KEY = 8, 16
"""In units: between maps, height of the key to the colours."""
_COLUMN, _SIDE, _BELOW = 200, 150, 110
"""In units: least width of a map's key, least width of a panel beside the maps, least height below."""
_LEAST_SIDE = 16
"""In units: least height of a side view."""


@dataclass(frozen=True)
class View(Box):
    """A map in the picture: x to the right, axis `up` (1 = y, 2 = z) upwards, projected along the third axis.

    Attributes:
        quantity: What it shows.
        up: The axis that points upwards.
        stretch: By how much a low side view is drawn higher than its proportions.
    """

    quantity: Literal["entropy", "coverage"] = "entropy"
    up: Literal[1, 2] = 1
    stretch: float = 1.0

    @property
    def title(self) -> str:
        """What it shows, from where, and by how much heights are exaggerated."""
        heights = f", height x {self.stretch:.1f}" if self.stretch > 1.0 else ""
        return f"{self.quantity}, from {'above' if self.up == 1 else 'the side'}{heights}"

    def place(self, points_m: np.ndarray, origin_m: np.ndarray, size_m: np.ndarray) -> np.ndarray:
        """Return where points (N, 3), map frame, metres, lie in the map: (N, 2) float64 pixels, x and y.

        Points farther outside than the map is wide are moved to that distance.
        """
        share = np.clip((points_m - origin_m) / size_m, -1.0, 2.0)
        return np.stack([share[:, 0] * self.width, (1.0 - share[:, self.up]) * self.height], axis=1)


@dataclass(frozen=True, eq=False)
class PageLayout:
    """Where everything lies in the picture.

    Attributes:
        unit: Size of the picture's details, in pixels.
        views: The maps.
        curves: The axes of the entropy curves.
        room: What is there for the curves, with the labels of their axes.
        status: Where the status lines go.
        page: All that does not change from frame to frame; to be copied, not changed.
    """

    unit: int
    views: tuple[View, ...]
    curves: Box
    room: Box
    status: Box
    page: Image.Image


@dataclass(frozen=True)
class _Arrangement:
    """One way to arrange the maps.

    Attributes:
        scale: Pixels a voxel; 0 = the keys to the colours do not fit.
        views: The maps.
        panel: What is left for status, legend and curves.
    """

    scale: float
    views: tuple[View, ...]
    panel: Box


@lru_cache(maxsize=16)
def lay_out(
    shape: tuple[int, int, int],
    voxel_size_m: float,
    robots: int,
    marks: tuple[Mark, ...],
    lines: int,
    width: int,
    height: int,
    kinds: int = 1,
) -> PageLayout:
    """Arrange maps, curves, legend and status, and draw what does not change.

    Args:
        shape: Voxels (X, Y, Z).
        voxel_size_m: Edge of a voxel.
        robots: Team size A.
        marks: What the legend explains beside the robots.
        lines: Number of status lines.
        width: Of the picture in pixels.
        height: Of the picture in pixels.
        kinds: Kinds of robots in the team.
    """
    unit = max(1, min(width // 560, height // 420))
    named = legend_rows(robots, marks)
    text_rows = lines + named + 1
    below = max(_BELOW, text_rows * LINE_HEIGHT) * unit
    choices = [
        _arranged(shape, width, height, unit, *columns_and_panel)
        for columns_and_panel in ((2, 0), (2, below), (1, below))
    ]
    best = max(choices, key=lambda choice: choice.scale)
    status, legend, room = _panel_boxes(best.panel, named, lines, unit)
    curves = _axes_within(room, unit)
    page = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(page)
    for view in best.views:
        write(draw, (view.left, view.top - 4 * unit), view.title, TEXT_SIZE * unit, "ls")
        outline(draw, view)
    for quantity in ("entropy", "coverage"):
        lowest = [view for view in best.views if view.quantity == quantity][-1]
        draw_key(page, quantity, lowest, unit, best.scale / voxel_size_m if quantity == "entropy" else None)
    draw_legend(draw, legend, robots, marks, unit, kinds)
    draw_axes(draw, curves, unit)
    return PageLayout(unit, best.views, curves, room, status, page)


def _arranged(
    shape: tuple[int, int, int], width: int, height: int, unit: int, columns: int, below: int
) -> _Arrangement:
    """Arrange the maps.

    Args:
        shape: Voxels (X, Y, Z).
        width: Of the picture.
        height: Of the picture.
        unit: Size of the picture's details, in pixels.
        columns: 2 = entropy beside coverage, 1 = entropy above coverage.
        below: Height of the panel below the maps; 0 = it is beside them.
    """
    ups = (1,) if shape[2] == 1 else (1, 2)
    margin, gap = MARGIN * unit, _GAP * unit
    stacks = 2 // columns
    room_x = width - 2 * margin - (_SIDE * unit + 2 * gap if below == 0 else 0)
    room_y = height - HEADER * unit - margin - below
    column = (room_x - (columns - 1) * 2 * gap) // columns
    around = stacks * (len(ups) * (LINE_HEIGHT * unit + gap) + _KEY * unit)
    scale = min(column / shape[0], (room_y - around) / (stacks * sum(shape[up] for up in ups)))
    side = _LEAST_SIDE * unit
    if len(ups) == 2 and scale * shape[2] < side:
        scale = min(column / shape[0], ((room_y - around) / stacks - side) / shape[1], side / shape[2])
    map_width = max(1, round(scale * shape[0]))
    if column < _COLUMN * unit:
        scale = 0.0
    elif below == 0:
        column = max(map_width, _COLUMN * unit)
    views: list[View] = []
    top = HEADER * unit
    for stack, quantity in enumerate(("entropy", "coverage")):
        left = margin + (stack * (column + 2 * gap) if columns == 2 else 0)
        top = HEADER * unit if columns == 2 else top
        for up in ups:
            stretch = max(1.0, side / (scale * shape[2])) if up == 2 and scale > 0.0 else 1.0
            map_height = max(1, round(stretch * scale * shape[up]))
            views.append(View(left, top + LINE_HEIGHT * unit, map_width, map_height, quantity, up, stretch))
            top += LINE_HEIGHT * unit + map_height + gap
        top += _KEY * unit
    if below == 0:
        left = margin + columns * column + (columns + 1) * gap
        top = HEADER * unit
        panel = Box(left, top, width - margin - left, height - margin - top)
    else:
        panel = Box(margin, top + gap, width - 2 * margin, height - margin - top - gap)
    return _Arrangement(scale, tuple(views), panel)


def _panel_boxes(panel: Box, named: int, lines: int, unit: int) -> tuple[Box, Box, Box]:
    """Return the boxes of status, legend of this many lines, and curves within the side panel."""
    narrow = panel.width < 1.6 * panel.height
    column = panel.width if narrow else _SIDE * unit
    status = Box(panel.left, panel.top, column, lines * LINE_HEIGHT * unit)
    legend_top = status.bottom + (_GAP * unit if lines else 0)
    legend = Box(panel.left, legend_top, column, named * LINE_HEIGHT * unit)
    left, top = panel.left, legend.bottom + 2 * _GAP * unit
    if not narrow:
        left, top = panel.left + column + 2 * _GAP * unit, panel.top
    return status, legend, Box(left, top, panel.right - left, panel.bottom - top)


def _axes_within(room: Box, unit: int) -> Box:
    """Return the axes of the curves, with their labels around them in what is there for the curves."""
    inset = round(text_width("100 %", TEXT_SIZE * unit)) + 5 * unit
    width = room.width - inset
    height = room.height - 2 * LINE_HEIGHT * unit
    return Box(room.left + inset, room.top + LINE_HEIGHT * unit, width, min(height, 2 * width))
