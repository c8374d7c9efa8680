"""Plans drawn as images, without a YAML, read with Pillow: dark pixels are solid.

The content decides what kind of image it is, not the suffix. A pixel's shade is the mean of its colours, from
0 (black) to 255; `negate` inverts it. A pixel is solid if its shade is below `occupied_below` (127.5, half of
white), else free, with `free_above` only if its shade is above that; others and all transparent ones are
unknown. The first row of the image lies at the largest y. A 16-bit greyscale PNG is a height map
(`elevation`): a count is `elevation_step_m`, its spacing `resolution_m`.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from entropy_explore_env.errors import SettingError
from entropy_explore_env.worlds.files.elevation import columns_of_rows
from entropy_explore_env.worlds.files.voxels import (
    FREE,
    MAX_PIXELS,
    SOLID,
    UNKNOWN,
    Options,
    RefusedError,
    Voxels,
    box_of_use,
    content,
    cropped_note,
)

NEEDS = ()
PIXEL_M = 0.05
"""Edge of a plan's pixel unless given otherwise: that of most maps of map_server."""
WHITE = 255.0
_FORMATS = ("PNG", "PPM", "JPEG", "BMP", "GIF")
_PLAIN_MODES = ("L", "LA", "RGB", "RGBA", "I", "I;16", "I;16L", "I;16B")
_PIXELS_AT_ONCE = 1 << 20
SAVED_AS_UNKNOWN = 205
"""The shade that map savers write for unknown."""
_GREY = (89.25, 204.5)
"""Shades that are neither dark nor light by the thresholds of most maps, 0.65 and 0.196."""
_MANY, _SOME = 0.1, 0.01
"""Shares of a plan's pixels from which it is noted that they are grey, and unknown though free."""


class Plan(NamedTuple):
    """A plan of (X, Y) pixels."""

    labels: np.ndarray
    """(X, Y) int8."""
    corner: tuple[int, int]
    """Pixels that were cropped before the first one along x and y."""
    notes: tuple[str, ...]


def read(path: Path, options: Options) -> Voxels:
    """Return a plan, one voxel high, or a height map."""
    picture = opened(path)
    if picture.format == "PNG" and picture.mode.startswith("I"):
        step_m = options.get("elevation_step_m")
        spacing_m = options.need("resolution_m", "a 16-bit PNG")
        counts = np.asarray(picture).astype(np.float64)
        return columns_of_rows(counts * (step_m or 1.0), (spacing_m, spacing_m), options)
    edge_m = float(options.get("resolution_m") or PIXEL_M)
    below, above = limits(options)
    below = 0.5 * WHITE if below is None else below
    negate = bool(options.get("negate"))

    def label(shades: np.ndarray) -> np.ndarray:
        shades = WHITE - shades if negate else shades
        light = FREE if above is None else np.where(shades > above, FREE, UNKNOWN)
        return np.where(shades < below, SOLID, light)

    plan = plan_of(picture, label, with_notes=limits(options) == (None, None))
    x, y = (n * edge_m for n in plan.corner)
    return Voxels(plan.labels[:, :, None], edge_m, (x, y, 0.0), notes=plan.notes)


def limits(options: Options) -> tuple[float | None, float | None]:
    """Return the options `occupied_below` and `free_above`: shades in [0, 255]; None = not given.

    Raises:
        SettingError: They contradict each other.
    """
    below, above = options.get("occupied_below"), options.get("free_above")
    if above is not None and above < (0.5 * WHITE if below is None else below) - 1.0:
        allowed = "a shade that occupied_below does not exceed by more than one"
        raise SettingError("free_above", above, allowed)
    return below, above


def opened(path: Path) -> Image.Image:
    """Return the image in a file, its pixels read; refused by the size in its header before that.

    Raises:
        RefusedError: It is no image of a known kind, or has too many pixels.
    """
    Image.MAX_IMAGE_PIXELS = None  # ours is checked below
    try:
        picture = Image.open(io.BytesIO(content(path)), formats=_FORMATS)
    except Image.UnidentifiedImageError:
        raise RefusedError("an image that is a PNG, PGM, JPEG, BMP or GIF, whatever its suffix") from None
    kind = picture.format
    if picture.width * picture.height > MAX_PIXELS:
        raise RefusedError(f"an image of at most {MAX_PIXELS} pixels")
    picture.load()
    if picture.mode not in _PLAIN_MODES:
        grey = picture.mode == "1"
        clear = picture.mode in ("PA", "La", "RGBa") or "transparency" in picture.info
        picture = picture.convert("L" if grey else "RGBA" if clear else "RGB")
    picture.format = kind
    return picture


def plan_of(
    picture: Image.Image,
    label: Callable[[np.ndarray], np.ndarray],
    opacity: str = "unknown",
    with_notes: bool = True,
) -> Plan:
    """Return the plan that an image shows, cropped where nothing is free in large margins.

    Args:
        picture: From `opened`.
        label: Gives the labels (N,) of shades (N,) in [0, 255].
        opacity: What is made of it: "unknown", pixels that are transparent at all are unknown; "averaged", it
            is one of the values whose mean is the shade; "ignored".
        with_notes: Whether to say what shades look as if they were meant otherwise.
    """
    bands = picture.getbands()
    transparent = bands[-1] == "A"
    summed = len(bands) - (transparent and opacity != "averaged")
    most = summed * (65535 if bands[0] == "I" else 255)
    shades = np.arange(most + 1) * (WHITE / most)
    of_level = label(shades).astype(np.int8)
    counts, clear = np.zeros(most + 1, np.int64), 0
    width, height = picture.size
    labels = np.empty((width, height), np.int8)
    rows = max(1, _PIXELS_AT_ONCE // width)
    for top in range(0, height, rows):
        bottom = min(height, top + rows)
        strip = np.asarray(picture.crop((0, top, width, bottom)))
        levels = strip if strip.ndim == 2 else strip[:, :, :summed].sum(axis=2, dtype=np.uint16)
        part = of_level[levels]
        if transparent and opacity == "unknown":
            seen_through = strip[:, :, -1] < WHITE
            part[seen_through] = UNKNOWN
            clear += int(seen_through.sum())
            levels = levels[~seen_through]
        counts += np.bincount(levels.ravel(), minlength=most + 1)
        labels[:, height - bottom : height - top] = part[::-1].T
    notes = _notes(shades, of_level, counts, clear) if with_notes else []
    box = box_of_use(labels == FREE)
    if box is None:
        return Plan(labels, (0, 0), tuple(notes))
    notes.append(cropped_note(labels.shape, box))
    return Plan(np.ascontiguousarray(labels[box]), (box[0].start, box[1].start), tuple(notes))


def _notes(shades: np.ndarray, labels: np.ndarray, counts: np.ndarray, clear: int) -> list[str]:
    """Return notes on shades that look as if they were meant otherwise.

    Args:
        shades: (N,) of the levels of an image.
        labels: (N,) of these.
        counts: (N,) how many opaque pixels have each.
        clear: How many pixels are transparent at all and therefore unknown.
    """
    pixels, notes = int(counts.sum()) + clear, []
    taken_as_free = int(counts[(np.abs(shades - SAVED_AS_UNKNOWN) < 1e-6) & (labels == FREE)].sum())
    if taken_as_free >= _SOME * pixels:
        notes.append(
            f"{taken_as_free:,} pixels of shade {SAVED_AS_UNKNOWN}, which map savers write for unknown, "
            f"count as free (free_above={SAVED_AS_UNKNOWN}, --free-above {SAVED_AS_UNKNOWN} makes them "
            "unknown)"
        )
    grey = (shades > _GREY[0]) & (shades < _GREY[1])
    if counts[grey].sum() >= _MANY * pixels:
        kinds = {SOLID: "solid", FREE: "free", UNKNOWN: "unknown"}
        each = [(int(counts[grey & (labels == label)].sum()), name) for label, name in kinds.items()]
        notes.append(
            "of the grey pixels, of shades from 90 to 204, "
            + " and ".join(f"{count:,} count as {name}" for count, name in each if count)
            + " (occupied_below and free_above, --occupied-below and --free-above, set the limits)"
        )
    if clear >= _SOME * pixels:
        notes.append(f"{clear:,} pixels that are not wholly opaque count as unknown")
    return notes
