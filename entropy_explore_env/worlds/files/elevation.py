"""Height maps as voxels, metres: solid columns below the surface, sky above it, a ceiling on request.

A sample stands for the rectangle around it. A column is as high as the highest sample that it overlaps, so
that ridges remain where voxels are larger than samples. A voxel is solid if its centre lies below the
surface; under the lowest ground there is one solid layer. Columns that overlap a sample without a value are
unknown.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.worlds.files.voxels import (
    FREE,
    SOLID,
    UNKNOWN,
    Options,
    RefusedError,
    Voxels,
    box_of_use,
    checked_shape,
    cropped_note,
)

SKY_VOXELS = 5
"""Free layers above the highest ground where neither `clearance_m` nor `ceiling_m` is given."""
MAX_SAMPLES = 1 << 25
METRES_PER_DEGREE = 2.0 * math.pi * 6_371_008.8 / 360.0
"""Along a meridian of a sphere as large as the Earth."""


def columns_of_rows(
    rows_m: np.ndarray,
    spacing_m: tuple[float, float],
    options: Options,
    corner_m: tuple[float, float] = (0.0, 0.0),
) -> Voxels:
    """Return the voxels of a height map whose rows (rows, columns) go from north to south; see `columns`."""
    return columns(np.ascontiguousarray(rows_m[::-1].T), spacing_m, options, corner_m)


def columns(
    elevation_m: np.ndarray,
    spacing_m: tuple[float, float],
    options: Options,
    corner_m: tuple[float, float] = (0.0, 0.0),
) -> Voxels:
    """Return the voxels of a height map.

    Args:
        elevation_m: (X, Y) float64 samples, x to the east and y to the north; NaN or inf = unknown.
        spacing_m: Between samples along x and y.
        options: `voxel_size_m` (None = the smaller spacing), `clearance_m` (sky above the highest ground),
            `ceiling_m` (height of the exposure surface above the ground of each column).
        corner_m: Of the sample (0, 0): where its rectangle begins.

    Raises:
        RefusedError: No heights, or too many voxels.
        SettingError: The ceiling leaves no room.
    """
    voxel_m = float(options.get("voxel_size_m") or min(spacing_m))
    clearance_m, ceiling_m = options.get("clearance_m"), options.get("ceiling_m")
    if ceiling_m is not None and ceiling_m < voxel_m:
        raise SettingError("ceiling_m", ceiling_m, f"at least one voxel ({voxel_m} m)")
    elevation_m = np.where(np.isfinite(elevation_m), elevation_m, np.nan)
    if elevation_m.size == 0 or np.isnan(elevation_m).all():
        raise RefusedError("a height map with heights in it")
    notes: tuple[str, ...] = ()
    if (box := box_of_use(~np.isnan(elevation_m))) is not None:
        notes = (cropped_note(elevation_m.shape, box),)
        elevation_m = elevation_m[box]
        steps = (box[0].start * spacing_m[0], box[1].start * spacing_m[1])
        corner_m = (corner_m[0] + steps[0], corner_m[1] + steps[1])
    low, high = float(np.nanmin(elevation_m)), float(np.nanmax(elevation_m))
    floor_m = low - voxel_m
    if clearance_m is None:
        clearance_m = SKY_VOXELS * voxel_m if ceiling_m is None else ceiling_m + voxel_m
    plan = [n * step / voxel_m for n, step in zip(elevation_m.shape, spacing_m, strict=True)]
    layers_above = max(1.0, math.ceil(clearance_m / voxel_m))
    try:
        shape = checked_shape([*plan, (high - floor_m) / voxel_m + layers_above])
    except RefusedError as error:
        raise RefusedError(f"{error}; its heights are from {low:.6g} to {high:.6g} m") from None
    top_m = _highest(
        _highest(elevation_m, shape[0], voxel_m / spacing_m[0]).T, shape[1], voxel_m / spacing_m[1]
    ).T
    known = ~np.isnan(top_m)
    layers = _layers_below(top_m, floor_m, voxel_m, shape[2])
    labels = np.full(shape, UNKNOWN, np.int8)
    for x in range(shape[0]):
        ground = np.where(np.arange(shape[2]) < layers[x, :, None], SOLID, FREE)
        labels[x, known[x]] = ground[known[x]]
    ceiling = None
    if ceiling_m is not None:
        ceiling = np.maximum(_layers_below(top_m + ceiling_m, floor_m, voxel_m, shape[2]), layers)
    return Voxels(labels, voxel_m, (*corner_m, floor_m), ceiling=ceiling, notes=notes)


def _layers_below(height_m: np.ndarray, floor_m: float, voxel_m: float, most: int) -> np.ndarray:
    """Return how many layers, (X, Y) int32, have centres below a surface (X, Y); all where it is NaN."""
    layers = np.ceil((height_m - floor_m) / voxel_m - 0.5 - 1e-9)
    return np.clip(np.where(np.isnan(layers), most, layers), 1, most).astype(np.int32)


def _highest(samples: np.ndarray, rows: int, width: float) -> np.ndarray:
    """Return (rows, …) the highest of the samples (N, …) that each row, `width` samples wide, overlaps."""
    last = len(samples)
    found = np.empty((rows, *samples.shape[1:]))
    for row in range(rows):
        first = min(last - 1, math.floor(row * width + 1e-9))
        end = max(first + 1, min(last, math.ceil((row + 1) * width - 1e-9)))
        found[row] = np.maximum.reduce(samples[first:end])  # NaN if one of them is
    return found


def degrees_as_metres(step_x: float, step_y: float, latitude: float) -> tuple[float, float]:
    """Return steps in degrees of longitude and latitude as metres, on a sphere, at a latitude in degrees."""
    return step_x * METRES_PER_DEGREE * math.cos(math.radians(latitude)), step_y * METRES_PER_DEGREE
