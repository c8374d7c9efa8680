"""Pictures of worlds: walls dark, free space light, unknown space blue, metres along the edges.

Solid voxels that give no return are red. Where robots may start is green.

Unknown is what a world's file says nothing of: to robots it is solid. Margins that hold no free space, and no
wall that the file knows of, are cut off.

A plan is drawn as it is. A 3-D world is drawn from above and from the side. Where the sky is open (terrain,
furniture), the view from above shows the height of the highest solid voxel of each column, and the side view
how much is solid along y; in worlds with a roof both show how much of the line of sight is free.
"""

from __future__ import annotations

import io
import math
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw
from scipy import ndimage

from entropy_explore_env.picture_text import base_m, font, shortened, text_width
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World, box_around, part_of

_LONG_SIDE = 880
_MARGIN = 64
_GAP = 64
_LEAST_WIDTH = 480
"""Of the picture; all in pixels."""
_TITLE_SIZE, _TEXT_SIZE = 18, 15
_LEAST_NAME = 80
"""A world's name is cut off to this width at most."""
_LEAST_SIDE = 60
"""A side view that would be lower is drawn higher."""
_ROOFED = 0.5
"""Above this share of columns that are solid at the top, a world counts as roofed."""
_PAPER, _INK = (255, 255, 255), (40, 44, 52)
_SOLID, _FREE = (58, 64, 77), (236, 239, 243)
_UNKNOWN, _UNREADABLE = (176, 200, 226), (190, 74, 72)
_START = (160, 205, 150)
_KEY = (
    (_SOLID, "wall"),
    (_FREE, "free"),
    (_UNKNOWN, "unknown"),
    (_UNREADABLE, "no return"),
    (_START, "may start"),
)
_KEY_SIZE = 12
_HEIGHT_COLOURS = (
    (38, 70, 83),
    (42, 157, 143),
    (138, 177, 125),
    (233, 196, 106),
    (244, 162, 97),
    (250, 244, 232),
)
"""From the lowest ground to the highest."""
_FREE_COLOURS = (_SOLID, (120, 132, 150), (190, 200, 212), _FREE)
"""From no free space along the line of sight to nothing else."""


class _View(NamedTuple):
    """A world seen along one axis."""

    title: str
    pixels: np.ndarray
    """(rows, columns, 3) uint8, a pixel a voxel; y or z upwards."""
    corner_m: tuple[float, float]
    """The lower left corner, in the world's frame."""
    stretch: int = 1
    """By how much heights are exaggerated."""


class _Axes(NamedTuple):
    """Where a view lies on the sheet, and its scale."""

    left: int
    top: int
    width: int
    height: int
    across: float
    """Pixels a metre to the right."""
    upwards: float
    """Pixels a metre upwards."""


def picture(world: World, starts: np.ndarray | None = None) -> bytes:
    """Return a PNG of a world, at most 1008 pixels wide.

    Args:
        world: The world.
        starts: (X, Y, Z) bool, where robots may start, which the plan or the view from above shows; None =
            not.
    """
    name, whole, box = world.name, world.grid, box_around(_seen(world))
    world = part_of(world, box)
    scale = _LONG_SIDE / max(world.grid.size_m[0], world.grid.size_m[1])  # pixels a metre, of all views
    views = _views(world, scale)
    if starts is not None:
        views[0] = _with_starts(views[0], starts[box])
    panels = [_panel(view, scale * world.grid.voxel_size_m) for view in views]
    width = max(_LEAST_WIDTH, max(panel.width for panel in panels) + 2 * _MARGIN)
    height = _MARGIN + sum(panel.height + _GAP for panel in panels) + 12
    sheet = Image.new("RGB", (width, height), _PAPER)
    draw = ImageDraw.Draw(sheet)
    draw.text((_MARGIN, 12), _title(name, whole, width - _MARGIN - 12), _INK, font(_TITLE_SIZE))
    top = _MARGIN
    for view, panel in zip(views, panels, strict=True):
        draw.text((_MARGIN, top - 22), view.title, _INK, font(_TEXT_SIZE))
        sheet.paste(panel, (_MARGIN, top))
        draw.rectangle((_MARGIN - 1, top - 1, _MARGIN + panel.width, top + panel.height), outline=_INK)
        axes = _Axes(_MARGIN, top, panel.width, panel.height, scale, scale * view.stretch)
        _draw_ticks(draw, axes, view.corner_m)
        top += panel.height + _GAP
    shown = [_in(views, _UNKNOWN, world.unknown), _in(views, _UNREADABLE, world.unreadable)]
    if any(shown) or starts is not None:
        walls = [world.grid.flat or any(shown)] * 2
        key = [*walls, *shown, starts is not None]
        _draw_key(draw, _MARGIN + panels[-1].width, top - _GAP / 4, key)
    buffer = io.BytesIO()
    sheet.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def _seen(world: World) -> np.ndarray:
    """(X, Y, Z) bool, what holds something to be seen: free space, what is around it, known walls."""
    seen = np.asarray(ndimage.binary_dilation(~world.occupied, np.ones((3, 3, 3))), np.bool_)
    return seen if world.unknown is None else seen | (world.occupied & ~world.unknown)


def _with_starts(view: _View, starts: np.ndarray) -> _View:
    """Return a view from above with the columns tinted in which robots may start."""
    columns = _upright(np.atleast_3d(np.any(starts, axis=2)))
    tinted = (0.5 * view.pixels + 0.5 * np.array(_START)).astype(np.uint8)
    return view._replace(pixels=np.where(columns, tinted, view.pixels))


def _in(views: list[_View], colour: tuple[int, int, int], mask: np.ndarray | None) -> bool:
    """Whether views of a world with such a mask show its colour."""
    return mask is not None and (colour == _UNKNOWN or any((v.pixels == colour).all(-1).any() for v in views))


def _draw_key(draw: ImageDraw.ImageDraw, right: float, middle: float, shown: list[bool]) -> None:
    """Draw what the colours mean, in a line that ends at a place."""
    for (colour, name), is_shown in reversed(list(zip(_KEY, shown, strict=True))):
        if not is_shown:
            continue
        right -= text_width(name, _TEXT_SIZE)
        draw.text((right, middle), name, _INK, font(_TEXT_SIZE), anchor="lm")
        right -= _KEY_SIZE + 6
        square = (right, middle - _KEY_SIZE / 2, right + _KEY_SIZE, middle + _KEY_SIZE / 2)
        draw.rectangle(square, fill=colour, outline=_INK)
        right -= 14


def _title(name: str, grid: Grid, width: float) -> str:
    """Name and size; the name is cut off where both do not fit."""
    size = " x ".join(_metres(edge) for edge in grid.size_m[: 2 if grid.flat else 3])
    about = f"   {size} m, voxels of {_metres(grid.voxel_size_m)} m"
    return shortened(name, max(width - text_width(about, _TITLE_SIZE), _LEAST_NAME), _TITLE_SIZE) + about


def _views(world: World, scale: float) -> list[_View]:
    """Return a plan, or a 3-D world from above and from the side; `scale` in pixels a metre."""
    solid, (x, y, z) = world.occupied, world.grid.origin_m
    if world.grid.flat:
        plan = np.where(solid[:, :, 0, None], _SOLID, _FREE).astype(np.uint8)
        if world.unknown is not None:
            plan[world.unknown[:, :, 0]] = _UNKNOWN
        if world.unreadable is not None:
            plan[world.unreadable[:, :, 0]] = _UNREADABLE
        return [_View("plan", _upright(plan), (x, y))]
    if world.unknown is not None:
        return _views_of_known(world, scale)
    layers = solid.shape[2]
    tops = layers - np.argmax(solid[:, :, ::-1], axis=2)
    tops[~solid.any(axis=2)] = 0
    free_along_y = (~solid).mean(axis=1)
    if float((tops == layers).mean()) > _ROOFED:
        above = _coloured((~solid).mean(axis=2), _FREE_COLOURS)
        title = "from above: how much is free, dark = none"
        side, side_title = np.sqrt(free_along_y), "from the side, along y: how much is free, dark = none"
    else:
        low_m, high_m = (float(top) * world.grid.voxel_size_m + z for top in (tops.min(), tops.max()))
        above = _coloured((tops - tops.min()) / max(1, int(np.ptp(tops))), _HEIGHT_COLOURS)
        title = f"from above: top of what is solid, {_metres(low_m)} m (dark) to {_metres(high_m)} m (light)"
        if world.unreadable is not None:
            highest = np.maximum(tops - 1, 0)[:, :, None]
            above[np.take_along_axis(world.unreadable, highest, axis=2)[:, :, 0]] = _UNREADABLE
        side = np.where(free_along_y < 1.0, 0.7 - 0.7 * np.sqrt(1.0 - free_along_y), 1.0)
        side_title = "from the side, along y: how much is solid, white = nothing"
    stretch = _stretch(world.grid.size_m[2] * scale)
    if stretch > 1:
        side_title += f", heights {stretch} times as large"
    return [
        _View(title, _upright(above), (x, y)),
        _View(side_title, _upright(_coloured(side, _FREE_COLOURS)), (x, z), stretch),
    ]


def _views_of_known(world: World, scale: float) -> list[_View]:
    """Return views of a world that is partly unknown: how much of the known line of sight is free."""
    assert world.unknown is not None
    x, y, z = world.grid.origin_m
    pictures = []
    for axis in (2, 1):
        known = (~world.unknown).mean(axis=axis)
        free = (~world.occupied).mean(axis=axis) / np.maximum(known, 1e-9)
        weight = np.minimum(2.0 * known, 1.0)[..., None]  # a line half of which is known counts as known
        shades = weight * _coloured(free, _FREE_COLOURS) + (1.0 - weight) * np.array(_UNKNOWN)
        pictures.append(_upright(shades.astype(np.uint8)))
    stretch = _stretch(world.grid.size_m[2] * scale)
    side_title = "from the side, along y" + (f", heights {stretch} times as large" if stretch > 1 else "")
    title = "from above: how much of what is known is free, dark = none"
    return [_View(title, pictures[0], (x, y)), _View(side_title, pictures[1], (x, z), stretch)]


def _metres(value: float) -> str:
    """Return a length with at most four digits, three below a metre; whole metres from 1000 m on."""
    if 0 < abs(value) < 1:
        return f"{value:.3g}"
    return f"{value:.4g}" if abs(value) < 1000 else f"{value:.0f}"


def _stretch(height: float) -> int:
    """Return the factor by which a side view of this height in pixels is drawn higher."""
    return 1 if height >= _LEAST_SIDE else math.ceil(_LEAST_SIDE / height)


def _upright(pixels: np.ndarray) -> np.ndarray:
    """(rows, columns, 3) of (X, Y, 3): x to the right, y up."""
    return np.ascontiguousarray(pixels.swapaxes(0, 1)[::-1])


def _coloured(shares: np.ndarray, colours: tuple[tuple[int, int, int], ...]) -> np.ndarray:
    """(X, Y, 3) uint8: shares in [0, 1], interpolated between equally spaced colours."""
    at = np.linspace(0.0, 1.0, len(colours))
    table = np.asarray(colours, np.float64)
    return np.stack([np.interp(shares, at, table[:, c]) for c in range(3)], axis=-1).astype(np.uint8)


def _panel(view: _View, pixels_a_voxel: float) -> Image.Image:
    """Return a view at its scale; sharp where voxels are enlarged, averaged where they are reduced."""
    rows, columns = view.pixels.shape[:2]
    size = max(1, round(columns * pixels_a_voxel)), max(1, round(rows * pixels_a_voxel * view.stretch))
    enlarged = pixels_a_voxel >= 1
    return Image.fromarray(view.pixels).resize(
        size, Image.Resampling.NEAREST if enlarged else Image.Resampling.BOX
    )


def _draw_ticks(draw: ImageDraw.ImageDraw, axes: _Axes, corner_m: tuple[float, float]) -> None:
    """Ticks with metres of the world's frame below and left of a view."""
    right, bottom = axes.left + axes.width, axes.top + axes.height
    bases_m = [base_m(corner) for corner in corner_m]
    for metres in _ticks(corner_m[0], axes.width / axes.across, _round_step(90.0 / axes.across)):
        x = axes.left + (metres - corner_m[0]) * axes.across
        draw.line((x, bottom, x, bottom + 6), _INK)
        draw.text((x, bottom + 8), f"{metres - bases_m[0]:.10g}", _INK, font(_TEXT_SIZE), anchor="ma")
    draw.text((right + 10, bottom - 12), "m", _INK, font(_TEXT_SIZE))
    if any(bases_m):
        said = f"metres from ({bases_m[0]:,.0f}, {bases_m[1]:,.0f})"
        draw.text((right, axes.top - 22), said, _INK, font(_TEXT_SIZE), anchor="ra")
    spacing = min(90.0, max(20.0, axes.height / 2.5))
    for metres in _ticks(corner_m[1], axes.height / axes.upwards, _round_step(spacing / axes.upwards)):
        y = bottom - (metres - corner_m[1]) * axes.upwards
        draw.line((axes.left - 6, y, axes.left, y), _INK)
        draw.text((axes.left - 9, y), f"{metres - bases_m[1]:.10g}", _INK, font(_TEXT_SIZE), anchor="rm")


def _round_step(least: float) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten that is at least this."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= least * (1 - 1e-9))


def _ticks(low: float, length: float, step: float) -> list[float]:
    """Return the multiples of a step from `low` on, within a length."""
    first, last = math.ceil(low / step - 1e-6), math.floor((low + length) / step + 1e-6)
    return [n * step for n in range(first, last + 1)]
