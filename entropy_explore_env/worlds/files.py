"""Worlds from files that people have."""

from __future__ import annotations

import importlib.util
import io
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy import sparse

from entropy_explore_env.config import MAX_VOXELS, Grid
from entropy_explore_env.errors import MissingExtraError, SettingError, WorldError
from entropy_explore_env.validation import is_number
from entropy_explore_env.worlds.world import World

MAX_FILE_BYTES = 256 << 20
_READ_TIMEOUT_S = 120
_FREE_AT_LEAST = 0.5
_OCCUPIED_BELOW = 0.25


def load_octomap(path: Path | str, voxel_size_m: float | None = None) -> World:
    """The world in an OctoMap binary tree (`.bt`), its voxels resampled.

    Unknown space counts as solid. Where voxels are resampled, one is free if at least half of it is
    known to be free and less than a quarter of it is occupied, so that thin walls stay.

    Args:
        path: The file.
        voxel_size_m: Edge of the voxels wanted; None = the file's own.

    Returns:
        The world in the file's frame.

    Raises:
        WorldError: The file is missing, too large, truncated or not an OctoMap.
        SettingError: The voxel size is not a number > 0.
        MissingExtraError: octomap-python is not installed.
    """
    if voxel_size_m is not None and not (is_number(voxel_size_m) and 0 < voxel_size_m < math.inf):
        raise SettingError("voxel_size_m", voxel_size_m, "a number > 0")
    path = Path(path)
    labels, edge_m, origin_m = _read_octomap(path)
    free, occupied = labels == 0, labels == 1
    if voxel_size_m is None or abs(voxel_size_m - edge_m) < 1e-9:
        solid, size_m = ~free, edge_m
    else:
        size_m = voxel_size_m
        voxels = math.prod(math.ceil(n * edge_m / size_m) for n in labels.shape)
        if voxels > MAX_VOXELS // 8:
            raise WorldError(
                "voxel_size_m", voxel_size_m, f"a size that gives at most {MAX_VOXELS // 8} voxels"
            )
        scale = size_m / edge_m
        solid = (_pooled(free, scale) < _FREE_AT_LEAST - 1e-9) | (_pooled(occupied, scale) >= _OCCUPIED_BELOW)
    shape = (int(solid.shape[0]), int(solid.shape[1]), int(solid.shape[2]))
    if solid.all():
        raise WorldError("world file", str(path), "a map with free space at this voxel size")
    return World(Grid(shape, size_m, origin_m), solid, path.stem)


def _read_octomap(path: Path) -> tuple[np.ndarray, float, tuple[float, float, float]]:
    """Voxels (X, Y, Z) int8 (-1 unknown, 0 free, 1 occupied), their edge in metres, and the origin."""
    if not path.is_file():
        raise WorldError("world file", str(path), "a file that exists")
    if path.stat().st_size > MAX_FILE_BYTES:
        raise WorldError("world file", str(path), f"at most {MAX_FILE_BYTES >> 20} MiB")
    if importlib.util.find_spec("octomap") is None:
        raise MissingExtraError("octomap-python", "worlds")
    script = Path(__file__).with_name("octomap_reader.py")
    try:
        reader = subprocess.run(
            [sys.executable, str(script), str(path.resolve())],
            capture_output=True,
            timeout=_READ_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise WorldError("world file", str(path), f"a map that is read within {_READ_TIMEOUT_S} s") from None
    if reader.returncode != 0:
        reason = reader.stderr.decode(errors="replace").strip().splitlines()
        refused = reader.returncode == 3 and reason
        raise WorldError("world file", str(path), reason[-1] if refused else "a whole OctoMap binary tree")
    header, _, body = reader.stdout.partition(b"\n")
    about = json.loads(header)
    x, y, z = about["origin_m"]
    return np.load(io.BytesIO(body), allow_pickle=False), about["voxel_size_m"], (x, y, z)


def _pooled(marked: np.ndarray, scale: float) -> np.ndarray:
    """Share of every new voxel that is marked: volume-weighted, new voxels `scale` old ones wide.

    Args:
        marked: (X, Y, Z) bool.
        scale: Edge of the new voxels in old ones.

    Returns:
        (X′, Y′, Z′) float64 in [0, 1]; what lies outside the old voxels is not marked.
    """
    share = marked.astype(np.float64)
    for axis in range(3):
        overlap = _overlap(share.shape[axis], scale)
        moved = np.moveaxis(share, axis, 0)
        pooled = overlap @ moved.reshape(moved.shape[0], -1)
        share = np.moveaxis(pooled.reshape(-1, *moved.shape[1:]), 0, axis)
    return share


def _overlap(old: int, scale: float) -> sparse.csr_array:
    """(new, old) matrix: share of each new interval, `scale` wide, that an old one, 1 wide, fills."""
    new = max(1, math.ceil(old / scale - 1e-9))
    rows, columns, shares = [], [], []
    for row in range(new):
        low, high = row * scale, (row + 1) * scale
        for column in range(math.floor(low), min(old, math.ceil(high))):
            rows.append(row)
            columns.append(column)
            shares.append((min(high, column + 1.0) - max(low, float(column))) / scale)
    return sparse.csr_array((shares, (rows, columns)), shape=(new, old))
