"""Point clouds in metres, z up: PCD (ASCII, binary, compressed) read with pypcd4, PLY with trimesh.

A voxel is solid if a point lies in it. A cloud has no information about free space: all other
voxels in its box count as free. It has no resolution of its own. A PLY with faces is a mesh (`meshes`).
"""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np

from entropy_explore_env.worlds.files.voxels import (
    FREE,
    SOLID,
    Options,
    RefusedError,
    Voxels,
    checked_shape,
    content,
)

NEEDS = (("pypcd4", "pypcd4"),)
_POINTS_AT_ONCE = 1 << 20
_MAX_SHRINKING = 64
"""LZF expands by about this factor at most; a header that states more is wrong."""


def read(path: Path, options: Options) -> Voxels:
    """The voxels that a PCD's points lie in."""
    import pypcd4

    data = content(path)
    _check_header(data)
    cloud = pypcd4.PointCloud.from_fileobj(io.BytesIO(data))  # type: ignore[arg-type]
    return voxels_of(np.asarray(cloud.numpy(("x", "y", "z")), np.float64), options)


def _check_header(data: bytes) -> None:
    """Refuse a PCD whose header states more points than its bytes can hold, before memory is allocated."""
    head = data[:4096].partition(b"\nDATA")[0].decode("ascii", "replace")
    words = {line.split()[0]: line.split()[1:] for line in head.splitlines() if line.strip()}
    points = int(words["POINTS"][0])
    if not 0 < points <= _MAX_SHRINKING * len(data):
        raise RefusedError("a PCD with as many points as its header says")
    size = sum(int(n) * int(c) for n, c in zip(words["SIZE"], words.get("COUNT", []), strict=True))
    if not 0 < size <= 1 << 12 or points * size > _MAX_SHRINKING * len(data) + 4096:
        raise RefusedError("a PCD with as many points as its header says")


def voxels_of(points_m: np.ndarray, options: Options) -> Voxels:
    """Voxels, on multiples of the voxel size, that points (N, 3) lie in; only finite ones count."""
    voxel_m = options.need("voxel_size_m", "a point cloud")
    finite = np.isfinite(points_m).all(axis=1)
    if not finite.all():
        points_m = points_m[finite]
    if len(points_m) == 0:
        raise RefusedError("a point cloud with points in it")
    low = np.floor(points_m.min(axis=0) / voxel_m + 1e-9)
    extent = np.floor(points_m.max(axis=0) / voxel_m + 1e-9) - low + 1.0
    labels = np.full(checked_shape(extent), FREE, np.int8)
    for first in range(0, len(points_m), _POINTS_AT_ONCE):
        some = points_m[first : first + _POINTS_AT_ONCE]
        index = (np.floor(some / voxel_m + 1e-9) - low).astype(np.int64)
        labels[tuple(index.T)] = SOLID
    x, y, z = (float(v) for v in low * voxel_m)
    if not all(math.isfinite(v) for v in (x, y, z)):
        raise RefusedError("a point cloud whose corner is finite")
    return Voxels(labels, voxel_m, (x, y, z))
