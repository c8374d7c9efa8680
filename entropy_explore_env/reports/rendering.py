"""One moment of a mission as a picture: maps of entropy and coverage, robots, entropy curves.

Maps keep the proportions of the workspace: x to the right, y (from above) or z (from the side) upwards. Side
views that would be a few pixels high are exaggerated in height, as their titles say; 2-D worlds have none.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from PIL import Image, ImageDraw

from entropy_explore_env.errors import SettingError
from entropy_explore_env.picture_text import printable, shortened, text_width
from entropy_explore_env.reports.annotations import (
    LINE_HEIGHT,
    MARK_RADIUS,
    TEXT_SIZE,
    Box,
    Mark,
    draw_cross,
    draw_diamond,
    draw_edged_line,
    draw_ring,
    draw_robot,
    draw_triangle,
    write,
)
from entropy_explore_env.reports.colours import COLOURS, INK, UNKNOWN_LEVEL, robot_colour
from entropy_explore_env.reports.page_layout import HEADER, MARGIN, PageLayout, View, lay_out
from entropy_explore_env.reports.projection import Projection, projections

_TITLE_SIZE = 20
"""Of the font, in units."""
_GAZE = 11
"""Length of the line that shows where a robot looks, in units."""
_ELLIPSE_POINTS = 49
_SIGMAS = 2.0
"""Of the ellipses around estimated places: 86 % of true ones are inside."""
_STATUS_LINES = 8
"""At most this many are drawn."""
_LEAST_WIDTH, _LEAST_HEIGHT = 480, 360


@dataclass(frozen=True, eq=False)
class Frame:
    """One moment of a mission, as a picture shows it. Frame of reference: map, metres, z up.

    Attributes:
        entropy_share: (X, Y, Z), the share in [0, 1] of each voxel's initial entropy that is left, in one
            robot's belief.
        coverage: (X, Y, Z), expected coverage in [0, 1].
        voxel_size_m: Edge of a voxel.
        origin_m: (3,), lower corner of voxel (0, 0, 0).
        positions_m: (A, 3), of the robots; NaN = not drawn.
        gazes_rad: (A, 2), yaw counter-clockwise and pitch downwards (REP-103).
        targets_m: (A, 3), the viewpoints that they chose; NaN = none.
        paths_m: The path that each robot has driven, (N, 3) each; an empty list = none are drawn.
        curve_s: (T,), times of the entropy curves; T may be 0.
        curve_share: (T, A), share of the entropy that is left at those times; drawn from 0 to 1.
        title: One line.
        status: Lines such as "time 123 s"; at most eight are drawn.
        stopped: Numbers of robots that a fault has stopped: a cross is drawn over them.
        kinds: K kinds of robots in the team, which differ in shape; robot a is of kind a mod K.
        covariances_m2: (A, 3, 3), of positions that are estimates: an ellipse of two standard deviations is
            drawn around each; (0, 3, 3) = none are.
        true_m: (A, 3), where the robots truly are then: a line leads there; (0, 3) = none is drawn.
        fiducials_m: (F, 3), landmarks.
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
    stopped: tuple[int, ...] = ()
    kinds: int = 1
    covariances_m2: np.ndarray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    true_m: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    fiducials_m: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

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
            "fiducials_m": (len(self.fiducials_m), 3),
        }
        if times:
            wanted["curve_share"] = (times, robots)
        for name, shape in wanted.items():
            if np.shape(getattr(self, name)) != shape:
                raise SettingError(f"Frame.{name}", np.shape(getattr(self, name)), f"a shape {shape}")
        for name, rest in (("covariances_m2", (3, 3)), ("true_m", (3,))):
            if np.shape(getattr(self, name)) not in ((0, *rest), (robots, *rest)):
                allowed = f"a shape {(robots, *rest)}, or {(0, *rest)}"
                raise SettingError(f"Frame.{name}", np.shape(getattr(self, name)), allowed)
        if len(self.paths_m) not in (0, robots):
            raise SettingError("Frame.paths_m", len(self.paths_m), f"0 or {robots} paths")

    @property
    def marks(self) -> tuple[Mark, ...]:
        """What is marked beside the robots."""
        shown = {
            Mark.VIEWPOINT: True,
            Mark.ESTIMATE: len(self.covariances_m2) > 0,
            Mark.TRUE_PLACE: len(self.true_m) > 0,
            Mark.FIDUCIAL: len(self.fiducials_m) > 0,
            Mark.STOPPED: len(self.stopped) > 0,
        }
        return tuple(mark for mark, there in shown.items() if there)


def draw_frame(frame: Frame, width: int = 640, height: int = 480) -> np.ndarray:
    """Draw one moment of a mission.

    How maps are projected along the line of sight is said in reports/projection.py. Where several cells share
    a pixel of a map of coverage, it shows the most covered one, so that thin walls stay visible. Paths and
    gazes are cut off at a map's edge; a robot close to the edge is drawn whole.

    Args:
        frame: What to show; not changed.
        width: Of the picture in pixels, at least 480.
        height: Of the picture in pixels, at least 360.

    Returns:
        (height, width, 3) uint8.

    Raises:
        SettingError: The picture would be too small to read.
    """
    for name, value, least in (("width", width, _LEAST_WIDTH), ("height", height, _LEAST_HEIGHT)):
        if value < least:
            raise SettingError(name, value, f"at least {least} pixels")
    status, layout = frame.status[:_STATUS_LINES], layout_of(frame, width, height)
    page, unit = layout.page.copy(), layout.unit
    draw = ImageDraw.Draw(page)
    _write_title(draw, frame.title, width - 2 * MARGIN * unit, unit)
    for number, line in enumerate(status):
        place = layout.status.left, layout.status.top + (number + 0.5) * LINE_HEIGHT * unit
        write(draw, place, shortened(line, layout.status.width, TEXT_SIZE * unit), TEXT_SIZE * unit, "lm")
    shares, coverage = (np.asarray(part, np.float32) for part in (frame.entropy_share, frame.coverage))
    projected = projections(shares, coverage)
    for view in layout.views:
        picture = _map_picture(view, projected[view.up - 1])
        _draw_robots(picture, view, frame, unit)
        page.paste(picture, (view.left, view.top))
    _draw_curves(draw, layout.curves, frame, unit)
    return np.array(page)


def layout_of(frame: Frame, width: int, height: int) -> PageLayout:
    """Return where everything lies in the picture of a frame."""
    shape, robots = np.shape(frame.entropy_share), len(frame.positions_m)
    size, lines = (width, height), len(frame.status[:_STATUS_LINES])
    return lay_out(shape, float(frame.voxel_size_m), robots, frame.marks, lines, *size, frame.kinds)


def _write_title(draw: ImageDraw.ImageDraw, title: str, width: int, unit: int) -> None:
    """Write the title in large letters, or in small ones where it is long."""
    fits = text_width(printable(title), _TITLE_SIZE * unit) <= width
    size = (_TITLE_SIZE if fits else TEXT_SIZE) * unit
    write(draw, (MARGIN * unit, HEADER / 2 * unit), shortened(title, width, size), size, "lm")


def _map_picture(view: View, projected: Projection) -> Image.Image:
    """Return a map without robots."""
    if view.quantity == "entropy":
        levels = np.clip(_pooled(projected.entropy, view, np.add), 0.0, 1.0) * 255.0
    else:
        pooled = _pooled(projected.coverage, view, np.maximum)
        levels = np.where(pooled < 0.0, UNKNOWN_LEVEL, np.minimum(pooled, 1.0) * (UNKNOWN_LEVEL - 1))
    cells = np.take(COLOURS[view.quantity], np.rint(levels).astype(np.uint8).T[::-1], axis=0)
    return Image.fromarray(cells).resize((view.width, view.height), Image.Resampling.NEAREST)


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


def _draw_robots(picture: Image.Image, view: View, frame: Frame, unit: int) -> None:
    """Draw driven paths, fiducials, chosen viewpoints, robots with their gazes, then where they truly are.

    What belongs to a robot has its colour.
    """
    draw = ImageDraw.Draw(picture)
    origin_m = np.asarray(frame.origin_m, dtype=np.float64)
    size_m = np.array(np.shape(frame.entropy_share)) * frame.voxel_size_m
    for robot, path_m in enumerate(frame.paths_m):
        points = view.place(np.reshape(path_m, (-1, 3)), origin_m, size_m)
        draw.line(points[np.isfinite(points).all(axis=1)].ravel().tolist(), robot_colour(robot), unit)
    for x, y in view.place(frame.fiducials_m, origin_m, size_m).tolist():
        draw_triangle(draw, (x, y), unit)
    for robot, covariance in enumerate(frame.covariances_m2):
        points = view.place(estimate_outline(frame.positions_m[robot], covariance, view.up), origin_m, size_m)
        draw_edged_line(draw, points, 2 * unit, robot_colour(robot))
    for robot, (x, y) in enumerate(view.place(frame.targets_m, origin_m, size_m).tolist()):
        if np.isfinite(x + y):
            draw_ring(draw, (x, y), unit, robot_colour(robot))
    yaw, pitch = np.asarray(frame.gazes_rad, dtype=np.float64).T
    level, rise = (1.0, np.sin(yaw)) if view.up == 1 else (np.cos(pitch), -np.sin(pitch))
    gazes = _GAZE * unit * np.stack([np.cos(yaw) * level, -rise], axis=1)
    inset = np.minimum((MARK_RADIUS + 1) * unit, (np.array([view.width, view.height]) - 1) / 2.0)
    places = view.place(frame.positions_m, origin_m, size_m)
    places = np.clip(places, inset, (view.width - 1, view.height - 1) - inset)
    for robot, ((x, y), (dx, dy)) in enumerate(zip(places.tolist(), gazes.tolist(), strict=True)):
        if np.isfinite(x + y + dx + dy):
            draw.line((x, y, x + 1.1 * dx, y + 1.1 * dy), INK, 2 * unit + 3)
            draw.line((x, y, x + dx, y + dy), robot_colour(robot), 2 * unit + 1)
            draw_robot(draw, (x, y), unit, robot_colour(robot), robot % frame.kinds)
            if robot in frame.stopped:
                draw_cross(draw, (x, y), unit)
    for robot, true_m in enumerate(frame.true_m):
        points = view.place(np.stack([frame.positions_m[robot], true_m]), origin_m, size_m)
        draw_edged_line(draw, points, unit, robot_colour(robot))
        x, y = points[1].tolist()
        draw_diamond(draw, (x, y), unit, robot_colour(robot))


def estimate_outline(centre_m: np.ndarray, covariance_m2: np.ndarray, up: int) -> np.ndarray:
    """Return the closed outline (N, 3) of two standard deviations around a place, in x and axis `up`."""
    axes = [0, up]
    variances, directions = np.linalg.eigh(np.asarray(covariance_m2)[np.ix_(axes, axes)])
    angles = np.linspace(0.0, 2.0 * np.pi, _ELLIPSE_POINTS)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1) * np.sqrt(np.maximum(variances, 0.0))
    points = np.repeat(np.asarray(centre_m, np.float64)[None], _ELLIPSE_POINTS, axis=0)
    points[:, axes] += _SIGMAS * around @ directions.T
    return points


def _draw_curves(draw: ImageDraw.ImageDraw, box: Box, frame: Frame, unit: int) -> None:
    """Draw one entropy curve for each robot, from time 0 to the last time."""
    if len(frame.curve_s) == 0:
        return
    few = np.unique(np.linspace(0, len(frame.curve_s) - 1, 4 * box.width).astype(np.int64))
    times_s, shares = np.asarray(frame.curve_s)[few], np.asarray(frame.curve_share)[few]
    last_s = float(times_s[-1])
    label = f"{last_s:.0f} s" if last_s >= 10.0 else f"{last_s:.1f} s"
    write(draw, (box.right, box.bottom + 3 * unit), label, TEXT_SIZE * unit, "ra")
    x = box.left + times_s / (last_s or 1.0) * (box.width - 1)
    y = box.top + (1.0 - np.clip(shares, 0.0, 1.0)) * (box.height - unit)
    for robot in range(shares.shape[1]):
        draw.line(np.stack([x, y[:, robot]], axis=1).ravel().tolist(), robot_colour(robot), 2 * unit)
