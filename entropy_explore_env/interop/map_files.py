"""Maps as files of other programs: map_server's, OctoMap's, PLY and NumPy's.

| suffix | what is written | what reads it |
| --- | --- | --- |
| `.yaml`, `.pgm` | both files: an image of a layer, and where it lies | ROS's map_server |
| `.bt`, `.ot` | which voxels are free, solid or unknown | OctoMap |
| `.ply` | a point at the centre of each solid voxel, in the map frame | any viewer of point clouds |
| `.npz` | mean and precision of every voxel, without loss | `load_map`; `load_world` as a world |
"""

from __future__ import annotations

import io
import json
import math
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.errors import SettingError, WorldError, imported, one_of
from entropy_explore_env.robots.rotations import turned_by
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.validation import check_instance, checked_path, is_number
from entropy_explore_env.worlds.files.archives import arrays, saved
from entropy_explore_env.worlds.files.images import SAVED_AS_UNKNOWN
from entropy_explore_env.worlds.files.voxels import FREE, SOLID, UNKNOWN, RefusedError, Voxels
from entropy_explore_env.writing import write_atomically

_SHADES = {FREE: 254, SOLID: 0, UNKNOWN: SAVED_AS_UNKNOWN}
"""What map savers write: with the thresholds below every reader's rule gives the labels back."""
_OCCUPIED_THRESH, _FREE_THRESH = 0.65, 0.196
_ON_LATTICE = 1e-3
"""Voxel edges by which OctoMap's lattice, whose corners are multiples of the edge, may be missed."""
_MOST_KEYS = 32768
"""Voxels of OctoMap's lattice on either side of the origin."""


def save_map(belief: Map, path: Path | str, heights_m: tuple[float, float] | None = None) -> list[Path]:
    """Write a map in the form that the suffix says; return the files.

    Args:
        belief: The map.
        path: A file ending in .yaml, .yml, .pgm, .bt, .ot, .ply or .npz.
        heights_m: map_server's files of 3-D maps: a column is solid if a voxel between these two heights is.

    Raises:
        SettingError: It is no Map, no form has this suffix, or the form cannot hold the map.
        MissingExtraError: A package is not installed.
        OSError: A file cannot be written.
    """
    check_instance("belief", belief, Map)
    path = checked_path("path", path)
    suffix = path.suffix.lower()
    if suffix not in (*_PLANS, *_WRITERS):
        raise SettingError("path", str(path), "a file ending in " + one_of(suffix, (*_PLANS, *_WRITERS)))
    plan = suffix in _PLANS
    if heights_m is not None and (not plan or belief.grid.flat):
        raise SettingError("heights_m", heights_m, "None, unless a 3-D map is written as .yaml or .pgm")
    if plan:
        return _save_plan(belief, path, heights_m)
    write_atomically(path, _WRITERS[suffix](belief))
    return [path]


def _save_plan(belief: Map, path: Path, heights_m: tuple[float, float] | None) -> list[Path]:
    """Write an image and its YAML."""
    labels, grid = _layer(belief, heights_m), belief.grid
    shades = np.zeros(labels.shape, np.uint8)
    for label, shade in _SHADES.items():
        shades[labels == label] = shade
    image, buffer = path.with_suffix(".pgm"), io.BytesIO()
    Image.fromarray(np.ascontiguousarray(shades.T[::-1])).save(buffer, "PPM")
    about = {
        "image": json.dumps(image.name, ensure_ascii=False),
        "mode": "trinary",
        "resolution": repr(float(grid.voxel_size_m)),
        "origin": [*(float(v) for v in grid.origin_m[:2]), float(belief.yaw_rad)],
        "negate": 0,
        "occupied_thresh": _OCCUPIED_THRESH,
        "free_thresh": _FREE_THRESH,
    }
    text = path if path.suffix.lower() != ".pgm" else path.with_suffix(".yaml")
    write_atomically(image, buffer.getvalue())
    write_atomically(text, "".join(f"{name}: {value}\n" for name, value in about.items()))
    return [text, image]


def _layer(belief: Map, heights_m: tuple[float, float] | None) -> np.ndarray:
    """Return the labels (X, Y) of a flat map, or of a 3-D one between two heights."""
    labels, grid = belief.labels(), belief.grid
    if grid.flat:
        return labels[:, :, 0]
    pair = isinstance(heights_m, tuple) and len(heights_m) == 2 and all(is_number(v) for v in heights_m)
    low, high = heights_m if pair and heights_m is not None else (math.nan, math.nan)
    centres_m = grid.origin_m[2] + (np.arange(grid.shape[2]) + 0.5) * grid.voxel_size_m
    inside = (centres_m >= low) & (centres_m <= high)
    if not inside.any():
        allowed = f"two heights of a 3-D map, from {centres_m[0]:g} to {centres_m[-1]:g} m"
        raise SettingError("heights_m", heights_m, allowed)
    layers = labels[:, :, inside]
    free = np.where((layers == FREE).any(axis=2), FREE, UNKNOWN)
    return np.where((layers == SOLID).any(axis=2), SOLID, free)


def octomap_of(belief: Map, full: bool) -> bytes:
    """Return a map as an OctoMap tree: the binary form .bt, or the full one .ot.

    Raises:
        SettingError: The grid is turned, its corners are no multiples of the voxels' edge, or it lies too far
            from the origin.
        MissingExtraError: octomap-python is not installed.
    """
    octomap = imported("octomap", "octomap-python", "worlds")
    grid, edge_m = belief.grid, belief.grid.voxel_size_m
    corner = np.asarray(grid.origin_m) / edge_m
    if belief.yaw_rad != 0.0 or np.abs(corner - np.rint(corner)).max() > _ON_LATTICE:
        found = f"corner {grid.origin_m} m, yaw {belief.yaw_rad:g}"
        allowed = f"a map that is not turned, with its corner at multiples of {edge_m:g} m, for OctoMap"
        raise SettingError("belief", found, allowed)
    low = np.rint(corner)
    if (low < -_MOST_KEYS).any() or (low + grid.shape > _MOST_KEYS).any():
        allowed = f"a map within {_MOST_KEYS * edge_m:g} m of the origin along each axis, for OctoMap"
        raise SettingError("belief", f"corner {grid.origin_m} m", allowed)
    tree, labels = octomap.OcTree(edge_m), belief.labels()
    for label in (FREE, SOLID):
        centres = (low + np.argwhere(labels == label) + 0.5) * edge_m
        if len(centres):
            tree.updateNodes(list(centres), label == SOLID, lazy_eval=True)
    tree.updateInnerOccupancy()
    return bytes(tree.write() if full else tree.writeBinary())


def solid_points(belief: Map) -> np.ndarray:
    """Return the centres (N, 3) of solid voxels in the map frame, metres."""
    offsets = (np.argwhere(belief.labels() == SOLID) + 0.5) * belief.grid.voxel_size_m
    return np.asarray(belief.grid.origin_m) + turned_by(offsets, belief.yaw_rad)


def _ply_of(belief: Map) -> bytes:
    """Return the solid voxels as a binary PLY of points."""
    points = solid_points(belief)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    return head.encode() + points.astype("<f8").tobytes()


def _npz_of(belief: Map) -> bytes:
    """Return a saved world with the map's arrays beside it."""
    grid = belief.grid
    world = Voxels(belief.labels(), grid.voxel_size_m, grid.origin_m, belief.yaw_rad, name="map")
    return saved(
        world, map_mean=belief.mean, map_precision=belief.precision, map_sigma_prior=belief.sigma_prior
    )


def load_map(path: Path | str) -> Map:
    """Return the map that `save_map` wrote as an .npz; nothing in it is executed.

    Raises:
        SettingError: It is no path.
        WorldError: The file cannot be read, or holds no map.
    """
    path = checked_path("path", path)
    try:
        entries = arrays(path.read_bytes())
        x, y, z = (float(v) for v in entries["origin_m"])
        mean = entries["map_mean"]
        grid = Grid((mean.shape[0], mean.shape[1], mean.shape[2]), float(entries["voxel_size_m"]), (x, y, z))
        prior, yaw_rad = float(entries["map_sigma_prior"]), float(entries["yaw_rad"])
        return Map(grid, mean, entries["map_precision"], prior, yaw_rad)
    except OSError as error:
        raise WorldError("path", str(path), f"a file that can be read ({error.strerror})") from None
    except (LookupError, ValueError, TypeError, EOFError, RuntimeError, RefusedError, *_BROKEN_ARCHIVE):
        raise WorldError("path", str(path), "an .npz that save_map wrote") from None


_BROKEN_ARCHIVE = (zipfile.BadZipFile, zlib.error)
_WRITERS: dict[str, Callable[[Map], bytes]] = {
    ".bt": lambda belief: octomap_of(belief, full=False),
    ".ot": lambda belief: octomap_of(belief, full=True),
    ".ply": _ply_of,
    ".npz": _npz_of,
}
"""Suffix → the content of a file of its own."""
_PLANS = (".yaml", ".yml", ".pgm")
"""Suffixes of the two files of map_server."""
