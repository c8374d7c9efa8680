"""Height maps as ESRI ASCII grids, `.asc`, in metres, read with NumPy.

The head states columns, rows, the lower left corner or the centre of its cell, and the edge of a cell
(cellsize, or dx and dy); samples equal to NODATA_value, -9999 unless stated, are unknown.
"""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np

from entropy_explore_env.worlds.files.elevation import MAX_SAMPLES, columns_of_rows
from entropy_explore_env.worlds.files.voxels import Options, RefusedError, Voxels, content

NEEDS = ()
_MAX_HEAD_LINES = 16


def read(path: Path, options: Options) -> Voxels:
    """Return the voxels of the grid."""
    lines = content(path).splitlines()
    about: dict[str, float] = {}
    for line in lines[:_MAX_HEAD_LINES]:
        words = line.decode("ascii", "replace").split()
        if len(words) != 2 or not words[0][:1].isalpha():
            break
        about[words[0].lower()] = float(words[1])
    if not {"ncols", "nrows"} <= about.keys():
        raise RefusedError("an ESRI ASCII grid with ncols, nrows and cellsize")
    step_x, step_y = about.get("dx", about.get("cellsize", 0.0)), about.get("dy", about.get("cellsize", 0.0))
    shape = (about["nrows"], about["ncols"])
    if not (0 < step_x < math.inf and 0 < step_y < math.inf and 0 < math.prod(shape) <= MAX_SAMPLES):
        raise RefusedError(f"an ESRI ASCII grid of at most {MAX_SAMPLES} cells with an edge > 0")
    numbers = np.loadtxt(io.BytesIO(b" ".join(lines[len(about) :])), np.float64, ndmin=1)
    rows = numbers.reshape(int(shape[0]), int(shape[1]))
    rows[rows == about.get("nodata_value", -9999.0)] = np.nan
    west = about.get("xllcorner", about.get("xllcenter", 0.5 * step_x) - 0.5 * step_x)
    south = about.get("yllcorner", about.get("yllcenter", 0.5 * step_y) - 0.5 * step_y)
    if not (math.isfinite(west) and math.isfinite(south)):
        raise RefusedError("an ESRI ASCII grid whose corner is finite")
    return columns_of_rows(rows, (step_x, step_y), options, (west, south))
