"""Which file is read by which reader, by its suffix, and what the options of reading may be."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, TypedDict

from entropy_explore_env.errors import SettingError, WorldError, did_you_mean, one_of
from entropy_explore_env.settings.validation import is_number
from entropy_explore_env.worlds.files.jacksboro import NAME as JACKSBORO
from entropy_explore_env.worlds.files.map_server import RULES
from entropy_explore_env.worlds.files.process import Format
from entropy_explore_env.worlds.public.table import PUBLIC

OCTOMAP = Format("octomap_tree", "OctoMap tree", memory_per_byte=512)
_MAP_SERVER = Format("map_server", "YAML of map_server with its image")
IMAGE = Format("images", "PNG, PGM, JPEG, BMP or GIF image")
_GEOTIFF = Format("geotiff", "GeoTIFF height map")
_MESH = Format("meshes", "mesh")
_LAS = Format("las", "LAS point cloud")
JACKSBORO_FORMAT = Format("jacksboro", "elevation model")
FORMATS = {
    ".bt": OCTOMAP,
    ".ot": OCTOMAP,
    ".yaml": _MAP_SERVER,
    ".yml": _MAP_SERVER,
    **dict.fromkeys((".png", ".pgm", ".ppm", ".pnm", ".jpg", ".jpeg", ".bmp", ".gif"), IMAGE),
    ".pcd": Format("point_clouds", "PCD point cloud"),
    ".las": _LAS,
    ".laz": _LAS,
    ".ply": _MESH,
    ".obj": _MESH,
    ".stl": _MESH,
    ".glb": _MESH,
    ".dae": _MESH,
    ".npz": Format("archives", "NumPy archive with a world or a height map"),
    ".tif": _GEOTIFF,
    ".tiff": _GEOTIFF,
    ".asc": Format("esri_grid", "ESRI ASCII grid"),
}
"""Suffix in lower case → how the file is read."""
NAMES = (JACKSBORO, *PUBLIC)
"""Names that stand for a world wherever a file may: names have no suffix, files have one."""
_TO_CONVERT = {
    ".npy": "a = numpy.load(path); World(Grid(a.shape, 0.05), a > 0, 'name'), with a of three axes",
    **dict.fromkeys((".fbx", ".blend", ".3ds", ".ifc", ".step", ".stp"), "export it as .glb or .obj"),
    **dict.fromkeys((".dxf", ".dwg", ".svg", ".pdf"), "export it as .png, black walls on white"),
    ".gltf": "trimesh.load('mesh.gltf').export('mesh.glb')",
    **dict.fromkeys((".e57", ".pts", ".xyz"), "pdal translate IN cloud.laz"),
    **dict.fromkeys((".bag", ".db3", ".mcap"), "play it, ros2 run nav2_map_server map_saver_cli -f map"),
}
"""Suffix of a file that is not read → what converts it."""

WORDS = {"map_rule": RULES, "up": ("y", "z")}
"""Options that are words → those that they may be."""


class LoadOptions(TypedDict, total=False):
    """Options of `load_world`, which describes them, beside its positional ones; None = not given."""

    resolution_m: float | None
    negate: bool | None
    occupied_below: float | None
    free_above: float | None
    map_rule: str | None
    elevation_step_m: float | None
    clearance_m: float | None
    ceiling_m: float | None
    fill: bool | None
    inside: bool | None
    scale: float | None
    gap_m: float | None
    up: str | None
    read_limit_s: float | None
    read_memory_mib: float | None


LOAD_OPTIONS = ("voxel_size_m", "height_m", *LoadOptions.__annotations__)
"""The names of all options of `load_world`."""


def format_of(path: Path) -> Format:
    """Return the format of a file.

    Raises:
        WorldError: Its suffix is not known; the message names what converts it.
    """
    suffix = path.suffix.lower()
    if suffix in FORMATS:
        return FORMATS[suffix]
    kinds = "a file of one of the kinds " + " ".join(FORMATS)
    line = f"; convert it: {_TO_CONVERT[suffix]}" if suffix in _TO_CONVERT else did_you_mean(str(path), NAMES)
    raise WorldError("world file", str(path), kinds + line)


def check_options(options: dict[str, Any]) -> None:
    """Check that numbers are > 0 and finite, shades in their range, words known and flags booleans.

    Args:
        options: Of `load_world`; numbers become floats.

    Raises:
        SettingError: One is unknown, or not allowed whatever the file.
    """
    for name, value in options.items():
        if name not in LOAD_OPTIONS:
            allowed = "one of the options " + ", ".join(LOAD_OPTIONS) + did_you_mean(name, LOAD_OPTIONS)
            raise SettingError(name, value, allowed)
        if value is None:
            continue
        if name in ("negate", "fill", "inside"):
            if not isinstance(value, bool):
                raise SettingError(name, value, "True or False")
        elif name in WORDS:
            if not isinstance(value, str) or value not in WORDS[name]:
                raise SettingError(name, value, one_of(value, WORDS[name]))
        elif name in ("occupied_below", "free_above"):
            if not is_number(value) or not 0 <= value <= 255:
                raise SettingError(name, value, "a shade from 0 (black) to 255")
            options[name] = float(value)
        elif not is_number(value) or not 0 < value < math.inf:
            raise SettingError(name, value, "a number > 0")
        else:
            options[name] = float(value)
