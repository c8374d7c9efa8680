"""Plans drawn as images, `.png` and `.pgm` without a YAML, read with Pillow: dark pixels are solid.

A pixel is solid where the mean of its colours is below half of white, or where it is transparent; the
first row of the image lies at the largest y. A 16-bit greyscale PNG is a height map (`elevation`): a
count is `elevation_step_m`, its spacing `resolution_m`.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

from entropy_explore_env.worlds.files.elevation import columns
from entropy_explore_env.worlds.files.voxels import FREE, SOLID, Options, RefusedError, Voxels, content

NEEDS = ()
PIXEL_M = 0.05
"""Edge of a plan's pixel unless given otherwise: that of most maps of map_server."""
MAX_PIXELS = 1 << 25
_FORMATS = {".png": "PNG", ".pgm": "PPM"}
_WHITE = 255.0


def read(path: Path, options: Options) -> Voxels:
    """A plan, one voxel high, or a height map."""
    picture = opened(path)
    if path.suffix.lower() == ".png" and picture.mode.startswith("I"):
        step_m = options.get("elevation_step_m")
        spacing_m = options.need("resolution_m", "a 16-bit PNG")
        counts = np.asarray(picture).astype(np.float64)
        return columns(
            from_rows(counts * (1.0 if step_m is None else step_m)), (spacing_m, spacing_m), options
        )
    edge_m = options.get("resolution_m")
    shades, opacity = shades_of(picture)
    dark = shades < 0.5 * _WHITE
    if options.get("negate"):
        dark = ~dark
    labels = np.where(dark | (opacity < _WHITE), SOLID, FREE).astype(np.int8)
    return Voxels(from_rows(labels)[:, :, None], PIXEL_M if edge_m is None else float(edge_m))


def opened(path: Path) -> Image.Image:
    """The image in a file, its pixels read; refused by the size in its header before that.

    Raises:
        RefusedError: It is no PNG or PGM, or has too many pixels.
    """
    if path.suffix.lower() not in _FORMATS:
        raise RefusedError("an image that is a .png or .pgm")
    picture = Image.open(io.BytesIO(content(path)), formats=[_FORMATS[path.suffix.lower()]])
    if picture.width * picture.height > MAX_PIXELS:
        raise RefusedError(f"an image of at most {MAX_PIXELS} pixels")
    picture.load()
    if picture.mode in ("P", "PA"):
        picture = picture.convert("RGBA" if "transparency" in picture.info else "RGB")
    return picture.convert("L") if picture.mode == "1" else picture


def shades_of(picture: Image.Image, with_opacity: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Mean of each pixel's colours and its opacity, both (rows, columns) float32 in [0, 255].

    Args:
        picture: From `opened`.
        with_opacity: Where the image has opacities, the mean is over them too.
    """
    pixels = np.asarray(picture)
    if pixels.ndim == 2:
        deep = picture.mode.startswith("I")
        shades = pixels.astype(np.float32) * np.float32(_WHITE / 65535.0 if deep else 1.0)
        return shades, np.broadcast_to(np.float32(_WHITE), shades.shape)
    transparent = picture.mode in ("LA", "RGBA")
    colours = pixels.shape[2] - transparent
    shades = np.zeros(pixels.shape[:2], np.float32)
    for channel in range(colours):
        shades += pixels[:, :, channel]
    opacity = pixels[:, :, -1].astype(np.float32) if transparent else np.broadcast_to(_WHITE, shades.shape)
    if transparent and with_opacity:
        return (shades + opacity) / np.float32(colours + 1), opacity
    return shades / np.float32(colours), opacity


def from_rows(rows: np.ndarray) -> np.ndarray:
    """(X, Y, …) from an image's (rows, columns, …): x to the right, y up."""
    return np.ascontiguousarray(np.swapaxes(rows[::-1], 0, 1))
