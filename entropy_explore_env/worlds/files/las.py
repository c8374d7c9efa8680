"""Point clouds of laser scanners, `.las` and `.laz`, read with laspy; as voxels see `point_clouds`."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from entropy_explore_env.worlds.files.point_clouds import voxels_of
from entropy_explore_env.worlds.files.voxels import Options, Voxels, content

NEEDS = (("laspy", "laspy"), ("lazrs", "laspy[lazrs]"))
_POINTS_AT_ONCE = 1 << 20


def read(path: Path, options: Options) -> Voxels:
    """Return the voxels that a cloud's points lie in."""
    import laspy

    parts = [np.zeros((0, 3))]
    with laspy.open(io.BytesIO(content(path))) as file:
        for some in file.chunk_iterator(_POINTS_AT_ONCE):
            axes = (some.x, some.y, some.z)
            parts.append(np.stack([np.asarray(axis, np.float64) for axis in axes], axis=1))
    return voxels_of(np.concatenate(parts), options)
