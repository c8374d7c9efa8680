"""A world file on a command line: how it is read, as the library's `load_world` has it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from entropy_explore_env.errors import SettingError


@dataclass
class Reading:
    """How world files are read; refused for files of other kinds."""

    height_m: float | None = None
    """Extrude a plan to this height."""
    resolution_m: float | None = None
    """Edge of an image's pixel, or spacing of a height map that does not say it."""
    negate: bool = False
    """Images: bright is solid."""
    occupied_below: float | None = None
    """Plans: pixels darker than this shade, 0 to 255, are solid."""
    free_above: float | None = None
    """Plans: pixels lighter than this shade are free, those between unknown."""
    map_rule: Literal["nav2", "map_server"] | None = None
    """How a YAML's thresholds and opacity are read: as Nav2 has it (default), or as before 2025."""
    elevation_step_m: float | None = None
    """Height of one count of a 16-bit image."""
    clearance_m: float | None = None
    """Free space above a height map, or around a mesh."""
    ceiling_m: float | None = None
    """Height of the exposure surface above the ground of a height map."""
    hollow: bool = False
    """Meshes: do not fill what they shut in."""
    inside: bool = False
    """Meshes: a building drawn by its inner walls, free inside and solid outside."""
    scale: float | None = None
    """Meshes and point clouds: metres of a unit, 0.001 for millimetres."""
    up: Literal["y", "z"] | None = None
    """Meshes and point clouds: the axis that points up."""
    read_limit_s: float | None = None
    """Seconds of computing that reading may take."""
    read_memory_mib: float | None = None
    """MiB of memory that reading may take; default: by the file's size."""

    def asked(self) -> dict[str, Any]:
        """Return what was asked for."""
        fields = dataclasses.asdict(self)
        return {name: value for name, value in fields.items() if value is not None and value is not False}

    def options(self) -> dict[str, Any]:
        """Return the same by the names of `load_world`."""
        options = self.asked()
        if options.pop("hollow", False):
            options["fill"] = False
        return options


def world_settings(worlds: Sequence[str], voxel_size_m: float | None, reading: Reading) -> dict[str, Any]:
    """Return settings of an environment in world files; what JSON holds.

    Args:
        worlds: The files; none = the scenario's own world.
        voxel_size_m: Edge of the voxels wanted; None = the scenario's.
        reading: How they are read. A single file of which nothing is asked stays a setting of the scenario,
            which a mission record refers to; else the record holds the world.

    Raises:
        SettingError: Something is asked for and there is no file.
    """
    size = {} if voxel_size_m is None else {"voxel_size_m": voxel_size_m}
    if not worlds:
        for name, value in (size | reading.asked()).items():
            raise SettingError(name, value, "--world beside it")
        return {}
    if len(worlds) > 1 or reading.asked():
        path = worlds[0] if len(worlds) == 1 else list(worlds)
        return {"world": {"path": path, **size, **reading.options()}}
    return {"world": worlds[0], **({"grid": size} if size else {})}
