"""Marks and annotations of mission pictures, drawn with Pillow: robots, viewpoints, keys, legend, axes.

Pixels; a point is (x, y), x to the right, y down. `unit` is the size of a picture's details: 1 in pictures of
640 × 480, 2 from 1120 × 840 on.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from entropy_explore_env.picture_text import font, text_width
from entropy_explore_env.reports.colours import (
    COLOURS,
    FAINT,
    INK,
    PAPER,
    ROBOT_COLOURS,
    UNKNOWN_COLOUR,
    Colour,
    robot_colour,
)

TEXT_SIZE = 12
"""Of the font, in units."""
LINE_HEIGHT = 14
"""From one line of text to the next, in units."""
MARK_RADIUS = 4
"""Of the marks of robots and viewpoints, in units."""
_SWATCH = 8
"""Height of a colour key, in units."""


class Mark(enum.Enum):
    """What a picture marks beside robots; the value is what its legend says."""

    VIEWPOINT = "chosen viewpoint"
    ESTIMATE = "pose estimate, 2 sigma"
    TRUE_PLACE = "where it truly is"
    FIDUCIAL = "fiducial"
    STOPPED = "stopped by a fault"


@dataclass(frozen=True)
class Box:
    """A rectangle of the picture, in pixels."""

    left: int
    top: int
    width: int
    height: int

    @property
    def right(self) -> int:
        """The first column beyond it."""
        return self.left + self.width

    @property
    def bottom(self) -> int:
        """The first row beyond it."""
        return self.top + self.height


def write(
    draw: ImageDraw.ImageDraw, place: tuple[float, float], text: str, size: int, anchor: str = "la"
) -> None:
    """Write a line of printable text.

    Args:
        draw: Of the picture.
        place: Where the text's anchor lies.
        text: What to write.
        size: Of the font in pixels.
        anchor: Pillow's: `la` = upper left corner, `lm` / `mm` / `rm` = left, middle, right at mid-height.
    """
    draw.text(place, text, INK, font(size), anchor=anchor)


def draw_disc(draw: ImageDraw.ImageDraw, centre: tuple[float, float], radius: float, colour: Colour) -> None:
    """Draw a filled disc with a dark edge, so that it stands out on any background."""
    draw.ellipse(_around(centre, radius + 1), INK)
    draw.ellipse(_around(centre, radius), colour)


def draw_robot(
    draw: ImageDraw.ImageDraw, centre: tuple[float, float], unit: int, colour: Colour, kind: int
) -> None:
    """Draw a robot: a disc if it is of the first kind, else a polygon with kind + 3 corners."""
    radius = MARK_RADIUS * unit
    if kind == 0:
        draw_disc(draw, centre, radius, colour)
        return
    draw.polygon(_corners(centre, radius + 2, kind + 3), INK)
    draw.polygon(_corners(centre, radius + 1, kind + 3), colour)


def draw_ring(
    draw: ImageDraw.ImageDraw, centre: tuple[float, float], unit: int, colour: Colour | None = None
) -> None:
    """Draw the mark of a chosen viewpoint: a ring with dark edges; without a colour, all of it dark."""
    radius = MARK_RADIUS * unit
    if colour is None:
        draw.ellipse(_around(centre, radius), outline=INK, width=2 * unit)
        return
    draw.ellipse(_around(centre, radius + 1), outline=INK, width=2 * unit + 2)
    draw.ellipse(_around(centre, radius), outline=colour, width=2 * unit)


def draw_cross(
    draw: ImageDraw.ImageDraw, centre: tuple[float, float], unit: int, radius: int = MARK_RADIUS + 3
) -> None:
    """Draw the mark over a robot that has stopped: a dark cross, by default larger than the robot's disc."""
    x, y = centre
    arm = radius * unit
    for side in (-1, 1):
        draw.line((x - arm, y - side * arm, x + arm, y + side * arm), INK, 2 * unit)


def draw_edged_line(
    draw: ImageDraw.ImageDraw, points: np.ndarray, width: int, colour: Colour | None = None
) -> None:
    """Draw a line with dark edges through (N, 2) points; without a colour, all of it dark."""
    corners = points.ravel().tolist()
    draw.line(corners, INK, width + 2)
    if colour is not None:
        draw.line(corners, colour, width)


def draw_diamond(
    draw: ImageDraw.ImageDraw, centre: tuple[float, float], unit: int, colour: Colour | None = None
) -> None:
    """Draw the mark of where a robot that drifts truly is: light, with an edge of its colour."""
    for radius, fill in ((MARK_RADIUS * unit + 1, INK), (MARK_RADIUS * unit, colour or INK)):
        draw.polygon(_corners(centre, radius, 4), fill)
    draw.polygon(_corners(centre, (MARK_RADIUS - 2) * unit, 4), PAPER)


def draw_triangle(draw: ImageDraw.ImageDraw, centre: tuple[float, float], unit: int) -> None:
    """Draw the mark of a fiducial: a light triangle with a dark edge."""
    draw.polygon(_corners(centre, (MARK_RADIUS + 1) * unit, 3), INK)
    draw.polygon(_corners(centre, (MARK_RADIUS - 1) * unit, 3), PAPER)


def _corners(centre: tuple[float, float], radius: float, number: int) -> list[tuple[float, float]]:
    """Return the corners of a regular polygon that stands on a corner or, with three of them, on a side."""
    angles = 2.0 * np.pi * np.arange(number) / number - np.pi / 2.0
    return [(centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)) for angle in angles]


def _around(centre: tuple[float, float], radius: float) -> tuple[float, float, float, float]:
    """Return the corners of the square around a circle."""
    x, y = centre
    return x - radius, y - radius, x + radius, y + radius


def outline(draw: ImageDraw.ImageDraw, box: Box) -> None:
    """Draw a dark frame of one pixel around a rectangle."""
    draw.rectangle((box.left - 1, box.top - 1, box.right, box.bottom), outline=INK)


def draw_key(
    page: Image.Image, quantity: str, view: Box, unit: int, pixels_per_m: float | None = None
) -> None:
    """Draw the key to the colours below a map.

    Args:
        page: Changed in place.
        quantity: `entropy` or `coverage`.
        view: The map.
        unit: Size of the picture's details.
        pixels_per_m: Scale of the map, for a scale bar; None = no scale bar.
    """
    draw, size, x = ImageDraw.Draw(page), TEXT_SIZE * unit, float(view.left)
    top = view.bottom + 5 * unit
    middle = top + _SWATCH * unit / 2
    low, high = ("0 %", "100 %") if quantity == "entropy" else ("free", "occupied")
    write(draw, (x, middle), low, size, "lm")
    bar = Box(round(x + text_width(low, size)) + 4 * unit, top, 50 * unit, _SWATCH * unit)
    levels = np.arange(bar.width) * (255 if quantity == "entropy" else 254) // (bar.width - 1)
    ramp = Image.fromarray(np.repeat(COLOURS[quantity][levels][None], bar.height, axis=0))
    outline(draw, bar)
    page.paste(ramp, (bar.left, bar.top))
    write(draw, (bar.right + 4 * unit, middle), high, size, "lm")
    x = bar.right + 4 * unit + text_width(high, size) + 10 * unit
    if quantity == "coverage":
        swatch = Box(round(x), top, _SWATCH * unit, _SWATCH * unit)
        outline(draw, swatch)
        draw.rectangle((swatch.left, swatch.top, swatch.right - 1, swatch.bottom - 1), UNKNOWN_COLOUR)
        write(draw, (swatch.right + 4 * unit, middle), "unknown", size, "lm")
    if pixels_per_m is not None:
        _draw_scale_bar(draw, (x, middle), unit, pixels_per_m)


def _draw_scale_bar(
    draw: ImageDraw.ImageDraw, place: tuple[float, float], unit: int, pixels_per_m: float
) -> None:
    """Draw a bar of a round number of metres, with its length."""
    x, y = place
    length_m = _round_length(40 * unit / pixels_per_m)
    end = x + length_m * pixels_per_m
    for corners in (
        (x, y, end, y),
        (x, y - 3 * unit, x, y + 3 * unit),
        (end, y - 3 * unit, end, y + 3 * unit),
    ):
        draw.line(corners, INK, unit)
    write(draw, (end + 4 * unit, y), f"{length_m:g} m", TEXT_SIZE * unit, "lm")


def _round_length(most: float) -> float:
    """Return the longest of …, 0.5, 1, 2, 5, 10, … that is not above `most`."""
    decade = 10.0 ** np.floor(np.log10(most))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= most * (1 + 1e-9)))


def legend_rows(robots: int, marks: tuple[Mark, ...]) -> int:
    """Return the lines of the legend: two robots each, and one for each mark."""
    return (min(robots, len(ROBOT_COLOURS)) + 1) // 2 + len(marks)


def draw_legend(
    draw: ImageDraw.ImageDraw, box: Box, robots: int, marks: tuple[Mark, ...], unit: int, kinds: int = 1
) -> None:
    """Draw the colours of the robots, two in a row, and what the marks mean; robot a is of kind a mod K."""
    shown, inset = min(robots, len(ROBOT_COLOURS)), (MARK_RADIUS + 1) * unit
    for robot in range(shown):
        left = box.left + robot % 2 * box.width // 2
        middle = box.top + (robot // 2 + 0.5) * LINE_HEIGHT * unit
        draw_robot(draw, (left + inset, middle), unit, robot_colour(robot), robot % kinds)
        more = ", …" if robot + shown < robots else ""
        write(draw, (left + 2 * inset + 4 * unit, middle), f"robot {robot}{more}", TEXT_SIZE * unit, "lm")
    for row, mark in enumerate(marks, start=legend_rows(robots, ())):
        place = box.left + inset, box.top + (row + 0.5) * LINE_HEIGHT * unit
        _draw_mark(draw, mark, place, unit)
        write(draw, (box.left + 2 * inset + 4 * unit, place[1]), mark.value, TEXT_SIZE * unit, "lm")


def _draw_mark(draw: ImageDraw.ImageDraw, mark: Mark, place: tuple[float, float], unit: int) -> None:
    """Draw a mark as the legend shows it."""
    if mark is Mark.VIEWPOINT:
        draw_ring(draw, place, unit)
    elif mark is Mark.TRUE_PLACE:
        draw_diamond(draw, place, unit)
    elif mark is Mark.FIDUCIAL:
        draw_triangle(draw, place, unit)
    elif mark is Mark.STOPPED:
        draw_cross(draw, place, unit, MARK_RADIUS)
    else:
        x, y, wide, high = *place, (MARK_RADIUS + 1) * unit, (MARK_RADIUS - 1) * unit
        draw.ellipse((x - wide, y - high, x + wide, y + high), outline=INK, width=2 * unit)


def draw_axes(draw: ImageDraw.ImageDraw, box: Box, unit: int) -> None:
    """Draw the axes of the entropy curves: share from 0 to 100 % over time."""
    size = TEXT_SIZE * unit
    write(draw, (box.left, box.top - 4 * unit), "entropy left", size, "ls")
    for percent in (0, 50, 100):
        y = box.top + round((1 - percent / 100) * (box.height - unit))
        draw.rectangle((box.left, y, box.right - 1, y + unit - 1), INK if percent == 0 else FAINT)
        write(draw, (box.left - 4 * unit, y), f"{percent} %", size, "rm")
    draw.rectangle((box.left, box.top, box.left + unit - 1, box.bottom - 1), INK)
    write(draw, (box.left, box.bottom + 3 * unit), "0", size, "la")
