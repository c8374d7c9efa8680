"""One moment of a mission as a picture: maps of entropy and coverage, robots, entropy curves.

Maps keep the proportions of the workspace: x to the right, y (from above) or z (from the side) up. Only
side views that would be a few pixels high are drawn higher, and say so; 2-D worlds have none.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.reports.glyphs import (
    COLOURS,
    INK,
    LINE_HEIGHT,
    PAPER,
    UNKNOWN_LEVEL,
    Box,
    disc,
    draw_axes,
    draw_key,
    draw_legend,
    legend_rows,
    line_pixels,
    paint,
    robot_colour,
    shortened,
    square,
    stamp,
    text_width,
    write,
)
from entropy_explore_env.reports.projection import Projection, projections


@dataclass(frozen=True, eq=False)
class Frame:
    """What one picture shows. Frame of reference: map, metres, z up.

    Attributes:
        entropy_share: (X, Y, Z), a voxel's entropy in [0, 1] of what it was at first; of one robot's
            belief or the mean of all robots'.
        coverage: (X, Y, Z), expected coverage in [0, 1].
        voxel_size_m: Edge of a voxel.
        origin_m: (3,), lower corner of voxel (0, 0, 0).
        positions_m: (A, 3), where the robots are.
        gazes_rad: (A, 2), yaw counter-clockwise and pitch downwards (REP-103).
        targets_m: (A, 3), the viewpoints that they chose; NaN = none.
        paths_m: The ways so far, one (N, 3) a robot, or none at all.
        curve_s: (T,), times of the entropy curves; T may be 0.
        curve_share: (T, A), remaining entropy at those times, about in [0, 1].
        title: One line.
        status: Lines such as "t 123 s".
    """

    entropy_share: np.ndarray
    coverage: np.ndarray
    voxel_size_m: float
    origin_m: np.ndarray
    positions_m: np.ndarray
    gazes_rad: np.ndarray
    targets_m: np.ndarray
    paths_m: list[np.ndarray]
    curve_s: np.ndarray
    curve_share: np.ndarray
    title: str
    status: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that the arrays fit each other."""
        robots, times = len(self.positions_m), len(self.curve_s)
        if np.ndim(self.entropy_share) != 3:
            raise SettingError("Frame.entropy_share", np.shape(self.entropy_share), "a shape (X, Y, Z)")
        wanted: dict[str, tuple[int, ...]] = {
            "coverage": np.shape(self.entropy_share),
            "origin_m": (3,),
            "positions_m": (robots, 3),
            "gazes_rad": (robots, 2),
            "targets_m": (robots, 3),
        }
        if times:
            wanted["curve_share"] = (times, robots)
        for name, shape in wanted.items():
            if np.shape(getattr(self, name)) != shape:
                raise SettingError(f"Frame.{name}", np.shape(getattr(self, name)), f"a shape {shape}")
        if len(self.paths_m) not in (0, robots):
            raise SettingError("Frame.paths_m", len(self.paths_m), f"0 or {robots} paths")


@dataclass(frozen=True)
class View(Box):
    """A map in the picture: x to the right, axis `up` (1 = y, 2 = z) up; the third is looked along."""

    quantity: Literal["entropy", "coverage"] = "entropy"
    up: Literal[1, 2] = 1
    stretch: float = 1.0

    @property
    def title(self) -> str:
        """What it shows, and how many times too high it is."""
        heights = f", heights × {self.stretch:.1f}" if self.stretch > 1.0 else ""
        return f"{self.quantity}, from {'above' if self.up == 1 else 'the side'}{heights}"

    def place(self, points_m: np.ndarray, origin_m: np.ndarray, size_m: np.ndarray) -> np.ndarray:
        """Where points (N, 3) of the map frame, metres, lie in the picture: (N, 2) float64, x and y."""
        share = np.clip((points_m - origin_m) / size_m, -1.0, 2.0)
        x, y = self.left + share[:, 0] * self.width, self.top + (1.0 - share[:, self.up]) * self.height
        return np.stack([x, y], axis=1)


@dataclass(frozen=True, eq=False)
class Layout:
    """Where everything lies in the picture.

    Attributes:
        unit: Pixels of the picture along a pixel of the font.
        views: The maps.
        curves: The axes of the entropy curves.
        status: Where the status lines go.
        paper: (H, W, 3) uint8, read-only; all that does not change from frame to frame.
    """

    unit: int
    views: tuple[View, ...]
    curves: Box
    status: Box
    paper: np.ndarray


_MARGIN, _HEADER, _GAP, _KEY = 8, 30, 8, 14
"""Heights in units: edge of the picture, title, between maps, key to the colours."""

_COLUMN, _SIDE, _BELOW = 196, 150, 110
"""In units: least width of a map's key, least width of a panel beside the maps, least height below."""

_LEAST_SIDE = 16
"""In units: side views are at least so high."""

_STATUS_LINES = 8
"""At most so many are shown."""


@lru_cache(maxsize=16)
def lay_out(
    shape: tuple[int, int, int], voxel_size_m: float, robots: int, lines: int, width: int, height: int
) -> Layout:
    """Arrange maps, curves, legend and status so that the maps become as large as they can.

    Args:
        shape: Voxels (X, Y, Z).
        voxel_size_m: Edge of a voxel.
        robots: Team size A.
        lines: Number of status lines.
        width: Of the picture in pixels.
        height: Of the picture in pixels.
    """
    unit = max(1, min(width // 560, height // 420))
    text = (lines + legend_rows(robots) + 2) * LINE_HEIGHT
    below = max(_BELOW, text) * unit
    ways = ((2, 0), (2, below), (1, below))
    choices = [_arranged(shape, width, height, unit, *way) for way in ways]
    scale, views, panel = max(choices, key=lambda choice: choice[0])
    paper = np.full((height, width, 3), PAPER, dtype=np.uint8)
    for view in views:
        write(paper, view.title, view.left, view.top - LINE_HEIGHT * unit, INK, unit)
        view.grown(1).of(paper)[:] = INK
    for quantity in ("entropy", "coverage"):
        lowest = [view for view in views if view.quantity == quantity][-1]
        draw_key(paper, quantity, lowest, unit, scale / voxel_size_m if quantity == "entropy" else None)
    status, legend, curves = _panel_boxes(panel, robots, lines, unit)
    draw_legend(paper, legend, robots, unit)
    draw_axes(paper, curves, unit)
    paper.setflags(write=False)
    return Layout(unit, views, curves, status, paper)


def _arranged(
    shape: tuple[int, int, int], width: int, height: int, unit: int, columns: int, below: int
) -> tuple[float, tuple[View, ...], Box]:
    """One way to arrange the maps: (pixels a voxel, maps, what is left); 0 pixels = keys do not fit.

    Args:
        shape: Voxels (X, Y, Z).
        width: Of the picture.
        height: Of the picture.
        unit: Pixels along a pixel of the font.
        columns: 2 = entropy beside coverage, 1 = entropy above coverage.
        below: Height of the panel below the maps; 0 = it is beside them.
    """
    ups = (1,) if shape[2] == 1 else (1, 2)
    margin, gap = _MARGIN * unit, _GAP * unit
    stacks = 2 // columns
    room_x = width - 2 * margin - (_SIDE * unit + 2 * gap if below == 0 else 0)
    room_y = height - _HEADER * unit - margin - below
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
    top = _HEADER * unit
    for stack, quantity in enumerate(("entropy", "coverage")):
        left = margin + (stack * (column + 2 * gap) if columns == 2 else 0)
        top = _HEADER * unit if columns == 2 else top
        for up in ups:
            stretch = max(1.0, side / (scale * shape[2])) if up == 2 and scale > 0.0 else 1.0
            map_height = max(1, round(stretch * scale * shape[up]))
            views.append(View(left, top + LINE_HEIGHT * unit, map_width, map_height, quantity, up, stretch))
            top += LINE_HEIGHT * unit + map_height + gap
        top += _KEY * unit
    if below == 0:
        left = margin + columns * column + (columns + 1) * gap
        top = _HEADER * unit
        return scale, tuple(views), Box(left, top, width - margin - left, height - margin - top)
    return scale, tuple(views), Box(margin, top + gap, width - 2 * margin, height - margin - top - gap)


def _panel_boxes(panel: Box, robots: int, lines: int, unit: int) -> tuple[Box, Box, Box]:
    """Status, legend and the axes of the curves within the side panel."""
    narrow = panel.width < 1.6 * panel.height
    text_width_px = panel.width if narrow else _SIDE * unit
    status = Box(panel.left, panel.top, text_width_px, lines * LINE_HEIGHT * unit)
    legend_top = status.top + status.height + (_GAP * unit if lines else 0)
    legend = Box(panel.left, legend_top, text_width_px, (legend_rows(robots) + 1) * LINE_HEIGHT * unit)
    left, top = panel.left, legend.top + legend.height + 2 * _GAP * unit
    if not narrow:
        left, top = panel.left + text_width_px + 2 * _GAP * unit, panel.top
    inset = text_width("100 %", unit) + 4 * unit
    width = panel.left + panel.width - left - inset
    height = panel.top + panel.height - top - 2 * LINE_HEIGHT * unit
    return status, legend, Box(left + inset, top + LINE_HEIGHT * unit, width, min(height, 2 * width))


def draw_frame(frame: Frame, width: int = 640, height: int = 480) -> np.ndarray:
    """Draw one moment of a mission.

    What the maps show of the line of sight is said in reports/projection.py. Where cells share a pixel,
    the most covered one shows, so that thin walls stay. Ways and gazes end at a map's edge; a robot close
    to it is drawn whole.

    Args:
        frame: What to show; not changed.
        width: Of the picture in pixels, at least 480.
        height: Of the picture in pixels, at least 360.

    Returns:
        (height, width, 3) uint8.

    Raises:
        SettingError: The picture would be too small to read.
    """
    for name, value, least in (("width", width, 480), ("height", height, 360)):
        if value < least:
            raise SettingError(name, value, f"at least {least} pixels")
    shape = np.shape(frame.entropy_share)
    robots, status = len(frame.positions_m), frame.status[:_STATUS_LINES]
    layout = lay_out(shape, float(frame.voxel_size_m), robots, len(status), width, height)
    image, unit = layout.paper.copy(), layout.unit
    scale = 2 * unit if text_width(frame.title, 2 * unit) <= width - 2 * _MARGIN * unit else unit
    title = shortened(frame.title, width - 2 * _MARGIN * unit, scale)
    write(image, title, _MARGIN * unit, _HEADER // 2 * unit - 4 * scale, INK, scale)
    for i, line in enumerate(status):
        box = layout.status
        write(image, shortened(line, box.width, unit), box.left, box.top + i * LINE_HEIGHT * unit, INK, unit)
    seen = projections(np.asarray(frame.entropy_share, np.float32), np.asarray(frame.coverage, np.float32))
    for view in layout.views:
        _draw_map(image, view, seen[view.up - 1])
    for up in (1, 2):
        _draw_robots(image, [view for view in layout.views if view.up == up], frame, unit)
    _draw_curves(image, layout.curves, frame, unit)
    return image


def _draw_map(image: np.ndarray, view: View, seen: Projection) -> None:
    """Fill a map's rectangle with its quantity."""
    if view.quantity == "entropy":
        levels = np.clip(_pooled(seen.entropy, view, np.add), 0.0, 1.0) * 255.0
    else:
        pooled = _pooled(seen.coverage, view, np.maximum)
        levels = np.where(pooled < 0.0, UNKNOWN_LEVEL, np.minimum(pooled, 1.0) * (UNKNOWN_LEVEL - 1))
    levels = np.rint(levels).astype(np.uint8)
    columns, rows = (
        np.minimum((2 * np.arange(pixels) + 1) * cells // (2 * pixels), cells - 1)
        for pixels, cells in zip((view.width, view.height), levels.shape, strict=True)
    )
    view.of(image)[:] = np.take(COLOURS[view.quantity], levels.T[rows[::-1]][:, columns], axis=0)


def _pooled(values: np.ndarray, view: View, pool: np.ufunc) -> np.ndarray:
    """Pool cells (N, M) that share a pixel, by mean (np.add) or maximum; at most (width, height) are left."""
    for axis, pixels in enumerate((view.width, view.height)):
        cells = values.shape[axis]
        if cells > pixels:
            starts = np.arange(pixels) * cells // pixels
            values = pool.reduceat(values, starts, axis=axis)
            if pool is np.add:
                counts = np.diff(starts, append=cells)
                values = values / (counts[:, None] if axis == 0 else counts)
    return values


def _draw_robots(image: np.ndarray, views: list[View], frame: Frame, unit: int) -> None:
    """Ways so far, chosen viewpoints, then the robots with their gazes, each in its robot's colour.

    The views are of one size and direction: what is drawn has the same pixels in each.
    """
    if not views:
        return
    view, canvases = views[0], [view.of(image) for view in views]
    origin = np.asarray(frame.origin_m, dtype=np.float64)
    size = np.array(np.shape(frame.entropy_share)) * frame.voxel_size_m

    def placed(points_m: np.ndarray) -> np.ndarray:
        return view.place(np.reshape(points_m, (-1, 3)), origin, size) - (view.left, view.top)

    def draw(points: np.ndarray, nib: np.ndarray, robot: int, edge: bool) -> None:
        pixels = line_pixels(points)
        for canvas in canvases:
            (stamp if edge else paint)(canvas, pixels, nib, robot_colour(robot))

    for robot, path_m in enumerate(frame.paths_m):
        draw(placed(path_m), square(unit), robot, edge=False)
    for robot, target in enumerate(placed(frame.targets_m)):
        draw(target[None], disc(4.0 * unit, 2.5 * unit), robot, edge=True)
    yaw, pitch = np.asarray(frame.gazes_rad, dtype=np.float64).T
    level, rise = (1.0, np.sin(yaw)) if view.up == 1 else (np.cos(pitch), -np.sin(pitch))
    ticks = 11.0 * unit * np.stack([np.cos(yaw) * level, -rise], axis=1)
    whole = np.minimum(5.0 * unit, (np.array([view.width, view.height]) - 1) / 2.0)
    inside = np.clip(placed(frame.positions_m), whole, (view.width - 1, view.height - 1) - whole)
    for robot, position in enumerate(inside):
        draw(np.stack([position, position + ticks[robot]]), square(2 * unit), robot, edge=True)
        draw(position[None], disc(4.0 * unit), robot, edge=True)


def _draw_curves(image: np.ndarray, box: Box, frame: Frame, unit: int) -> None:
    """One entropy curve a robot, from time 0 to the last time."""
    if len(frame.curve_s) == 0:
        return
    few = np.unique(np.linspace(0, len(frame.curve_s) - 1, 4 * box.width).astype(np.int64))
    times, shares = np.asarray(frame.curve_s)[few], np.asarray(frame.curve_share)[few]
    last = float(times[-1])
    label = f"{last:.0f} s" if last >= 10.0 else f"{last:.1f} s"
    right = box.left + box.width - text_width(label, unit)
    write(image, label, right, box.top + box.height + 4 * unit, INK, unit)
    window = box.grown(unit)
    x = unit + times / (last or 1.0) * (box.width - 1)
    y = unit + (1.0 - np.clip(shares, 0.0, 1.0)) * (box.height - unit)
    for robot in range(shares.shape[1]):
        pixels = line_pixels(np.stack([x, y[:, robot]], axis=1))
        paint(window.of(image), pixels, square(2 * unit), robot_colour(robot))
