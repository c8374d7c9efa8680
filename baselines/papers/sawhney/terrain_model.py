"""A model of real ground to fly over: the elevations of Jacksboro, Tennessee, that come with matplotlib.

30 × 32 km in 1 : 400, as wide as the other terrains; its 840 m in 1 : 50, as high as they are. The ridges of
the fault stand out as they do in pictures of it, eight times as steep as they are.
"""

from __future__ import annotations

import io
import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np
from matplotlib import cbook

from entropy_explore_env.writing import write_atomically

CEILING_M = 4.0
"""Height of the exposure surface above the ground."""
_FOLDER = tempfile.TemporaryDirectory(prefix="entropy_explore_env-")
ACROSS, UP = 400.0, 50.0
"""Scales of the model."""
_METRES_PER_DEGREE = 111_195.0
"""Along a meridian."""


@lru_cache(maxsize=1)
def model_file() -> str:
    """Return the path of the model, a height map that `load_world` reads, written for this process."""
    with np.load(
        cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False), allow_pickle=False
    ) as dem:
        elevation_m, middle = dem["elevation"] / UP, 0.5 * np.radians(dem["ymin"] + dem["ymax"])
        spacing_m = np.array([dem["dx"] * np.cos(middle), dem["dy"]]) * _METRES_PER_DEGREE / ACROSS
    buffer = io.BytesIO()
    np.savez_compressed(buffer, elevation=elevation_m, spacing_m=spacing_m)
    path = Path(_FOLDER.name) / "jacksboro.npz"
    write_atomically(path, buffer.getvalue())
    return str(path)
