"""Pictures of worlds: solid space dark, free space light, metres along the edges; drawn with Pillow.

A plan is drawn as it is. A 3-D world is drawn from above and from the side. Where the sky is open (terrain,
furniture), the view from above shows how high the highest solid voxel stands and the side view what is solid
along y; in worlds with a roof both show how much of the line of sight is free.
"""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np

from entropy_explore_env.errors import MissingExtraError
from entropy_explore_env.worlds.world import World

_LONG_SIDE = 880
_MARGIN = 64
_GAP = 56
_PAPER, _INK = (255, 255, 255), (40, 44, 52)
_SOLID, _FREE = (58, 64, 77), (236, 239, 243)
_LOW_TO_HIGH = (
    (38, 70, 83),
    (42, 157, 143),
    (138, 177, 125),
    (233, 196, 106),
    (244, 162, 97),
    (250, 244, 232),
)
"""Colours of heights, from the lowest to the highest."""
_SHALLOW_TO_DEEP = ((58, 64, 77), (120, 132, 150), (190, 200, 212), (236, 239, 243))
"""Colours of how much of a column is free, from nothing to all of it."""


def picture(world: World) -> bytes:
    """A PNG of a world, at most about 1000 pixels wide.

    Raises:
        MissingExtraError: Pillow is not installed.
    """
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError:
        raise MissingExtraError("pillow", "worlds") from None
    views = _views(world)
    size_m, edge = world.grid.size_m, world.grid.voxel_size_m
    scale = _LONG_SIDE / max(size_m[0], size_m[1])  # pixels a metre, the same for all views
    stretches = [1 if number == 0 else _stretch(size_m[2] * scale) for number in range(len(views))]
    panels = [
        _panel(Image, pixels, scale * edge, stretch)
        for (_, pixels, _), stretch in zip(views, stretches, strict=True)
    ]
    small, large = ImageFont.load_default(15), ImageFont.load_default(18)
    width = max(480, max(panel.width for panel in panels) + 2 * _MARGIN)
    height = _MARGIN + sum(panel.height + _GAP + 8 for panel in panels) + 12
    sheet = Image.new("RGB", (width, height), _PAPER)
    draw = ImageDraw.Draw(sheet)
    draw.text((_MARGIN, 12), _title(world, large, width - _MARGIN - 12), _INK, large)
    top = _MARGIN
    for panel, stretch, (title, _, origin_m) in zip(panels, stretches, views, strict=True):
        title += f", heights {stretch} times as large" if stretch > 1 else ""
        draw.text((_MARGIN, top - 22), title, _INK, small)
        sheet.paste(panel, (_MARGIN, top))
        draw.rectangle((_MARGIN - 1, top - 1, _MARGIN + panel.width, top + panel.height), outline=_INK)
        box = (_MARGIN, top, panel.width, panel.height)
        _scale(draw, small, box, (scale, scale * stretch), origin_m)
        top += panel.height + _GAP + 8
    buffer = io.BytesIO()
    sheet.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def _title(world: World, font: Any, room: float) -> str:  # noqa: ANN401 - Pillow's
    size = " x ".join(_metres(edge) for edge in world.grid.size_m[: 2 if world.grid.flat else 3])
    about = f"   {size} m, voxels of {_metres(world.grid.voxel_size_m)} m"
    name = world.name
    while len(name) > 8 and font.getlength(name + about) > room:
        name = name[:-4] + "..."
    return name + about


def _views(world: World) -> list[tuple[str, np.ndarray, tuple[float, float]]]:
    """Title, colours (rows, columns, 3) uint8 with y or z upwards, and the lower left corner in metres."""
    solid, (x, y, z) = world.occupied, world.grid.origin_m
    if world.grid.flat:
        pixels = np.where(solid[:, :, 0, None], _SOLID, _FREE).astype(np.uint8)
        return [("plan", _upright(pixels), (x, y))]
    height = solid.shape[2]
    open_sky = height - np.argmax(solid[:, :, ::-1], axis=2)
    open_sky[~solid.any(axis=2)] = 0
    free_along_y = (~solid).mean(axis=1)
    if float((open_sky == height).mean()) > _ROOFED:
        above = _shaded((~solid).mean(axis=2), _SHALLOW_TO_DEEP)
        title = "from above: how much is free, dark = none"
        side, side_title = np.sqrt(free_along_y), "from the side, along y: how much is free, dark = none"
    else:
        low, high = (float(v) * world.grid.voxel_size_m + z for v in (open_sky.min(), open_sky.max()))
        share = (open_sky - open_sky.min()) / max(1, int(np.ptp(open_sky)))
        above = _shaded(share, _LOW_TO_HIGH)
        title = f"from above: top of what is solid, {_metres(low)} m (dark) to {_metres(high)} m (light)"
        side = np.where(free_along_y < 1.0, 0.7 - 0.7 * np.sqrt(1.0 - free_along_y), 1.0)
        side_title = "from the side, along y: how much is solid, white = nothing"
    return [
        (title, _upright(above), (x, y)),
        (side_title, _upright(_shaded(side, _SHALLOW_TO_DEEP)), (x, z)),
    ]


def _metres(value: float) -> str:
    """A length in four digits at most, or two where it is smaller than a metre; whole metres from 1000 m."""
    if 0 < abs(value) < 1:
        return f"{value:.2g}"
    return f"{value:.4g}" if abs(value) < 1000 else f"{value:.0f}"


def _stretch(height: float) -> int:
    """How many times as high a side view is drawn that would be a few pixels high."""
    return 1 if height >= _LEAST_SIDE else math.ceil(_LEAST_SIDE / height)


_LEAST_SIDE = 60
_ROOFED = 0.5
"""Above this share of columns that are solid at the top, a world counts as roofed."""


def _upright(pixels: np.ndarray) -> np.ndarray:
    """(rows, columns, 3) of (X, Y, 3): x to the right, y up."""
    return np.ascontiguousarray(pixels.swapaxes(0, 1)[::-1])


def _shaded(share: np.ndarray, colours: tuple[tuple[int, int, int], ...]) -> np.ndarray:
    """(X, Y, 3) uint8: shares in [0, 1] along a row of colours."""
    at = np.linspace(0.0, 1.0, len(colours))
    table = np.asarray(colours, np.float64)
    return np.stack([np.interp(share, at, table[:, c]) for c in range(3)], axis=-1).astype(np.uint8)


def _panel(image: Any, pixels: np.ndarray, edge: float, stretch: int) -> Any:  # noqa: ANN401 - Pillow's
    """A view at so many pixels a voxel; sharp where voxels grow, averaged where they shrink."""
    rows, columns = pixels.shape[:2]
    size = (max(1, round(columns * edge)), max(1, round(rows * edge * stretch)))
    return image.fromarray(pixels).resize(
        size, image.Resampling.NEAREST if edge >= 1 else image.Resampling.BOX
    )


def _scale(
    draw: Any,  # noqa: ANN401 - Pillow's
    font: Any,  # noqa: ANN401
    box: tuple[int, int, int, int],
    scale: tuple[float, float],
    origin_m: tuple[float, float],
) -> None:
    """Ticks with metres of the world's frame below and left of a view (left, top, width, height)."""
    left, top, width, height = box
    step = _round_step(90.0 / scale[0])
    for metres in _ticks(origin_m[0], width / scale[0], step):
        x = left + (metres - origin_m[0]) * scale[0]
        draw.line((x, top + height, x, top + height + 6), _INK)
        draw.text((x, top + height + 8), f"{metres:.10g}", _INK, font, anchor="ma")
    draw.text((left + width + 10, top + height - 12), "m", _INK, font)
    upwards = _round_step(min(90.0, max(20.0, height / 2.5)) / scale[1])
    for metres in _ticks(origin_m[1], height / scale[1], upwards):
        y = top + height - (metres - origin_m[1]) * scale[1]
        draw.line((left - 6, y, left, y), _INK)
        draw.text((left - 9, y), f"{metres:.10g}", _INK, font, anchor="rm")


def _round_step(least: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is at least this."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= least * (1 - 1e-9))


def _ticks(low: float, length: float, step: float) -> list[float]:
    first, last = math.ceil(low / step - 1e-6), math.floor((low + length) / step + 1e-6)
    return [n * step for n in range(first, last + 1)]
