"""Height maps as GeoTIFF, `.tif` and `.tiff`, read with tifffile.

Spacing and corner come from its tags (ModelPixelScale, ModelTiepoint; OGC GeoTIFF 1.1); degrees become
metres at the latitude of the map's middle, counted from its south-west corner. A TIFF without these tags
needs `resolution_m`.
"""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.worlds.files.elevation import MAX_SAMPLES, columns, degrees_as_metres
from entropy_explore_env.worlds.files.images import from_rows
from entropy_explore_env.worlds.files.voxels import Options, RefusedError, Voxels, content

NEEDS = (("tifffile", "tifffile"),)
_NODATA_TAG = 42113
_GEOGRAPHIC = 2
_PIXEL_IS_POINT = 2


def read(path: Path, options: Options) -> Voxels:
    """The first page's elevation in metres."""
    import tifffile

    with tifffile.TiffFile(io.BytesIO(content(path))) as file:
        page: Any = file.pages.first
        if len(page.shape) != 2 or page.dtype is None or page.dtype.kind not in "iuf":
            raise RefusedError("a GeoTIFF of one layer of numbers")
        if math.prod(page.shape) > MAX_SAMPLES:
            raise RefusedError(f"a height map of at most {MAX_SAMPLES} samples")
        rows = page.asarray(maxworkers=1).astype(np.float64)
        nodata = page.tags.get(_NODATA_TAG)
        tags = page.geotiff_tags or {}
    if nodata is not None:
        rows[rows == float(str(nodata.value).strip("\0 "))] = np.nan
    elevation = from_rows(rows)
    scale, tie = tags.get("ModelPixelScale"), tags.get("ModelTiepoint")
    if scale is None:
        edge_m = options.need("resolution_m", "a TIFF without ModelPixelScale")
        return columns(elevation, (edge_m, edge_m), options)
    step_x, step_y = float(scale[0]), float(scale[1])
    if not (0 < step_x < math.inf and 0 < step_y < math.inf):
        raise RefusedError("a GeoTIFF whose pixels have a size > 0")
    i, j, _, x, y, _ = (float(v) for v in (tie[:6] if tie is not None else (0, 0, 0, 0, 0, 0)))
    if tags.get("GTRasterTypeGeoKey") == _PIXEL_IS_POINT:
        i, j = i + 0.5, j + 0.5
    west, south = x - i * step_x, y - (elevation.shape[1] - j) * step_y
    if not (math.isfinite(west) and math.isfinite(south)):
        raise RefusedError("a GeoTIFF whose corner is finite")
    if tags.get("GTModelTypeGeoKey") == _GEOGRAPHIC:
        middle = south + 0.5 * elevation.shape[1] * step_y
        if not -90.0 < middle < 90.0:
            raise RefusedError("a GeoTIFF between the poles")
        return columns(elevation, degrees_as_metres(step_x, step_y, middle), options)
    return columns(elevation, (step_x, step_y), options, (west, south))
