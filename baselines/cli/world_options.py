"""A world file on a command line: how it is read, as the library's `load_world` has it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal


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
    gap_m: float | None = None
    """Point clouds: gaps between points up to this width are solid."""
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
