"""Height maps as GeoTIFF, `.tif` and `.tiff`, read with tifffile and, where compressed, imagecodecs.

Spacing and corner come from its tags (ModelPixelScale and ModelTiepoint, or ModelTransformation; OGC GeoTIFF
1.1), with or without a directory of keys; degrees become metres at the latitude of the map's middle, counted
from its south-west corner. Heights are those of GDAL: samples equal to its nodata, in the raster's type, are
unknown, others are scaled and offset as its metadata say. Units across and up are those that the keys or
GDAL's metadata name, else those of the reference system whose EPSG code the keys state (looked up with
pyproj), else metres; feet and kilometres are converted. A TIFF without tags of place needs `resolution_m`.
"""

from __future__ import annotations

import io
import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.errors import MissingExtraError, imported
from entropy_explore_env.worlds.files.elevation import MAX_SAMPLES, columns_of_rows, degrees_as_metres
from entropy_explore_env.worlds.files.voxels import Options, RefusedError, Voxels, content

NEEDS = (("tifffile", "tifffile"),)
_PIXEL_SCALE, _TIE_POINTS, _TRANSFORMATION = 33550, 33922, 34264
_GDAL_METADATA, _GDAL_NODATA = 42112, 42113
_GEOGRAPHIC = 2
_PIXEL_IS_POINT = 2
_DEGREE, _OWN_UNIT = 9102, 32767
_FOOT, _SURVEY_FOOT = 0.3048, 1200.0 / 3937.0
_METRES = {9001: 1.0, 9002: _FOOT, 9003: _SURVEY_FOOT, 9036: 1000.0}
"""EPSG code of a unit → metres."""
_METRES_BY_NAME = {
    **dict.fromkeys(("m", "metre", "meter", "metres", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "international foot", "international feet"), _FOOT),
    **dict.fromkeys(("us-ft", "ftus", "us survey foot", "us survey feet", "foot_us"), _SURVEY_FOOT),
}
_UNITS = "metres, kilometres, feet or US survey feet"
_SYSTEM_OF_UNITS = {"ProjLinearUnits": "ProjectedCSTypeGeoKey", "VerticalUnits": "VerticalCSTypeGeoKey"}
"""Which key states the reference system whose unit holds where no key states the unit."""
_LAST_SYSTEM = 32766
"""EPSG codes of reference systems in keys end here; 32767 is a system that the file describes itself."""


class _Place(NamedTuple):
    """Where a raster lies, in units of its reference system."""

    step: tuple[float, float]
    """Edges of a pixel along x and y."""
    corner: tuple[float, float]
    """Upper left corner of the raster, or centre of its first pixel where pixels are points."""


def read(path: Path, options: Options) -> Voxels:
    """Return the first page's elevation in metres."""
    import tifffile

    with tifffile.TiffFile(io.BytesIO(content(path))) as file:
        page: Any = file.pages.first
        if len(page.shape) != 2 or page.dtype is None or page.dtype.kind not in "iuf":
            raise RefusedError("a GeoTIFF of one layer of numbers")
        if math.prod(page.shape) > MAX_SAMPLES:
            raise RefusedError(f"a height map of at most {MAX_SAMPLES} samples")
        tags = {tag.code: tag.value for tag in page.tags}
        keys = {name: value for name, value in (page.geotiff_tags or {}).items() if name.endswith("GeoKey")}
        try:
            raw = page.asarray(maxworkers=1)
        except ValueError as error:
            if "imagecodecs" in str(error):
                raise MissingExtraError("imagecodecs", "worlds") from None
            raise
    rows_m = _heights_m(raw, tags, keys)
    height = len(rows_m)
    place = _place(tags)
    if place is None:
        edge_m = options.need("resolution_m", "a TIFF without ModelPixelScale and ModelTransformation")
        return columns_of_rows(rows_m, (edge_m, edge_m), options)
    (step_x, step_y), (x, y) = place
    if keys.get("GTRasterTypeGeoKey") == _PIXEL_IS_POINT:
        x, y = x - 0.5 * step_x, y + 0.5 * step_y
    west, south = x, y - height * step_y
    if not (math.isfinite(west) and math.isfinite(south)):
        raise RefusedError("a GeoTIFF whose corner is finite")
    if keys.get("GTModelTypeGeoKey") == _GEOGRAPHIC:
        middle = south + 0.5 * height * step_y
        if not -90.0 < middle < 90.0 or keys.get("GeogAngularUnitsGeoKey", _DEGREE) != _DEGREE:
            raise RefusedError("a GeoTIFF in degrees, between the poles")
        return columns_of_rows(rows_m, degrees_as_metres(step_x, step_y, middle), options)
    unit_m = _unit_m(keys, "ProjLinearUnits")
    return columns_of_rows(
        rows_m, (step_x * unit_m, step_y * unit_m), options, (west * unit_m, south * unit_m)
    )


def _heights_m(raw: np.ndarray, tags: Mapping[int, Any], keys: Mapping[str, Any]) -> np.ndarray:
    """Return the raster's samples in metres, (rows, columns) float64; NaN where one is missing."""
    rows = raw.astype(np.float64)
    stated = str(tags.get(_GDAL_NODATA, "")).strip("\0 \t\r\n")
    if stated:
        with np.errstate(over="ignore", invalid="ignore"):
            nodata = np.float64(stated).astype(raw.dtype)
        if raw.dtype.kind == "f" or nodata == float(stated):  # whole numbers have no NaN
            rows[raw == nodata] = np.nan
    about = _gdal_items(tags.get(_GDAL_METADATA))
    named = about.get("unittype", "").strip().lower()
    if not named or "VerticalUnitsGeoKey" in keys:
        unit_m = _unit_m(keys, "VerticalUnits")
    elif named in _METRES_BY_NAME:
        unit_m = _METRES_BY_NAME[named]
    else:
        raise RefusedError(f"a GeoTIFF whose heights are in {_UNITS}, not in {named[:40]}")
    return (rows * float(about.get("scale", 1.0)) + float(about.get("offset", 0.0))) * unit_m


def _gdal_items(text: Any) -> dict[str, str]:  # noqa: ANN401 - whatever the tag holds
    """Return what GDAL's metadata say of the first band: role → text."""
    if not isinstance(text, str) or not text.strip("\0 \r\n"):
        return {}
    items = ET.fromstring(text.strip("\0 \r\n"))
    return {
        item.get("role", ""): item.text or ""
        for item in items
        if item.get("role") and item.get("sample") == "0"
    }


def _place(tags: Mapping[int, Any]) -> _Place | None:
    """Return where the raster lies; None where it has no tags that say so."""
    scale, tie, matrix = (tags.get(code) for code in (_PIXEL_SCALE, _TIE_POINTS, _TRANSFORMATION))
    if scale is not None:
        step_x, step_y = float(scale[0]), float(scale[1])
        i, j, _, x, y, _ = (float(v) for v in (tie[:6] if tie is not None else (0, 0, 0, 0, 0, 0)))
        corner = (x - i * step_x, y + j * step_y)
    elif matrix is not None:
        step_x, step_y, corner = float(matrix[0]), -float(matrix[5]), (float(matrix[3]), float(matrix[7]))
        if matrix[1] != 0.0 or matrix[4] != 0.0:
            raise RefusedError("a GeoTIFF with north up: gdalwarp IN OUT turns it")
    else:
        return None
    if not (0 < step_x < math.inf and 0 < step_y < math.inf):
        raise RefusedError("a GeoTIFF whose pixels have a size > 0, rows from the north")
    return _Place((step_x, step_y), corner)


def _unit_m(keys: Mapping[str, Any], name: str) -> float:
    """Return the metres of the unit that the keys state, or that their reference system has; else 1.

    Args:
        keys: Name of a GeoKey → its value.
        name: `ProjLinearUnits` or `VerticalUnits`.

    Raises:
        RefusedError: The unit or the reference system is unknown.
        MissingExtraError: pyproj, which knows the units of reference systems, is needed and not installed.
    """
    if f"{name}GeoKey" not in keys:
        return _unit_of_system_m(int(keys.get(_SYSTEM_OF_UNITS[name], 0)))
    code = int(keys[f"{name}GeoKey"])
    if code == _OWN_UNIT and 0 < float(keys.get("ProjLinearUnitSizeGeoKey", 0.0)) < math.inf:
        return float(keys["ProjLinearUnitSizeGeoKey"])
    if code not in _METRES:
        raise RefusedError(f"a GeoTIFF whose {name} are {_UNITS}, not EPSG {code}")
    return _METRES[code]


def _unit_of_system_m(code: int) -> float:
    """Return the metres of the unit of a reference system by its EPSG code; 1 if no system has it."""
    if not 0 < code <= _LAST_SYSTEM:
        return 1.0
    pyproj = imported("pyproj", "pyproj", "worlds")
    try:
        return float(pyproj.CRS.from_epsg(code).axis_info[0].unit_conversion_factor)
    except pyproj.exceptions.CRSError:
        raise RefusedError(f"a GeoTIFF whose reference system is known, not EPSG {code}") from None
