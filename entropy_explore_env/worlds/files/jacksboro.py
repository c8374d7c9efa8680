"""The elevation model of Jacksboro fault, Tennessee, that comes with matplotlib: 344 × 403 samples of 3″.

Heights are metres; degrees become metres as in `geotiff`, counted from the south-west corner.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from entropy_explore_env.worlds.files.elevation import columns_of_rows, degrees_as_metres
from entropy_explore_env.worlds.files.voxels import Options, Voxels

NEEDS = (("matplotlib.cbook", "matplotlib"),)
NAME = "jacksboro"


def read(path: Path, options: Options) -> Voxels:
    """Return the model's voxels; the path is its name."""
    del path
    from matplotlib import cbook

    with np.load(
        cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False), allow_pickle=False
    ) as dem:
        rows = dem["elevation"].astype(np.float64)
        middle = 0.5 * (float(dem["ymin"]) + float(dem["ymax"]))
        spacing_m = degrees_as_metres(float(dem["dx"]), float(dem["dy"]), middle)
    return columns_of_rows(rows, spacing_m, options)
