"""What a reader returns: labelled voxels in the frame of the file, metres and radians.

The readers in this folder run in a separate process (`worker`), and import little so that it starts fast.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.grid import MAX_VOXELS_ALONG_AXIS

UNKNOWN, FREE, SOLID, UNREADABLE = -1, 0, 1, 2
"""Labels of voxels; those unreadable are solid, too, and give no return to a range sensor."""
FREE_AT_LEAST = 0.5
OCCUPIED_BELOW = 0.25
ROUNDING = 1e-9
"""Where voxels are resampled, one is free if at least so much of its volume is known to be free and less than
so much is solid; sums of volumes are compared with this slack, as a share of a voxel."""
MAX_FILE_BYTES = 1 << 30
MAX_FILE_VOXELS = 130_000_000
"""Voxels of one file, at its own resolution or at the one asked for."""
MAX_PIXELS = 1 << 29
"""Pixels of a plan, which becomes voxels of the size asked for."""
WORTH_CROPPING = 1 << 20
"""Margins of fewer pixels, samples or columns than this stay."""


class RefusedError(Exception):
    """A reader cannot use the file; the message states what is allowed."""


@dataclass(frozen=True, eq=False)
class Voxels:
    """A file's content.

    Attributes:
        labels: (X, Y, Z) int8: UNKNOWN, FREE, SOLID or UNREADABLE; Z = 1 is a 2-D plan.
        voxel_size_m: Edge of a voxel.
        origin_m: Lower corner of voxel (0, 0, 0) in the file's frame.
        yaw_rad: Rotation of the voxels' axes against the file's frame, about `origin_m`.
        ceiling: (X, Y) int32, the lowest layer of the no-fly zone in each column, or None.
        name: Of the world, where the file states one.
        notes: What the user should know of how the file was read, a sentence without a stop each.
    """

    labels: np.ndarray
    voxel_size_m: float
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0
    ceiling: np.ndarray | None = None
    name: str | None = None
    notes: tuple[str, ...] = ()


class Options:
    """Settings for a reader; those that it does not use are refused, not ignored."""

    def __init__(self, given: Mapping[str, Any]) -> None:
        """Keep those that are not None."""
        self._given = {name: value for name, value in given.items() if value is not None}
        self._asked = {"voxel_size_m"}  # every file can be resampled

    def get(self, name: str) -> Any:  # noqa: ANN401 - numbers and flags
        """Return a setting's value; None = not given."""
        self._asked.add(name)
        return self._given.get(name)

    def need(self, name: str, kind: str) -> float:
        """Return a setting's value.

        Raises:
            SettingError: It is not given.
        """
        value = self.get(name)
        if value is None:
            flag = name.replace("_", "-")
            raise SettingError(name, None, f"a number > 0 (--{flag}): {kind} does not state it")
        return float(value)

    def refuse_unused(self, kind: str) -> None:
        """Raise a SettingError for the first setting that the reader did not use."""
        for name, value in self._given.items():
            if name not in self._asked:
                raise SettingError(name, value, f"None: it does not apply to {kind}")


def box_of_use(used: np.ndarray) -> tuple[slice, slice] | None:
    """Return the box of what is of use in a plan, with a margin of one, if the rest is worth to be cropped.

    Args:
        used: (X, Y) bool.

    Returns:
        The box's slices; None where the plan should stay whole.
    """
    box = []
    for axis in range(2):
        along = np.flatnonzero(used.any(axis=1 - axis))
        if len(along) == 0:
            return None
        box.append(slice(max(0, int(along[0]) - 1), min(used.shape[axis], int(along[-1]) + 2)))
    kept = (box[0].stop - box[0].start) * (box[1].stop - box[1].start)
    return None if used.size - kept < WORTH_CROPPING else (box[0], box[1])


def cropped_note(shape: Sequence[int], box: tuple[slice, slice]) -> str:
    """Return the note on a plan (X, Y) of which only a box is kept."""
    x, y = (each.stop - each.start for each in box)
    return f"cropped from {shape[0]} × {shape[1]} to {x} × {y}, as no robot can get beyond"


def memory_allowed(limit_bytes: int) -> str:
    """Return what is allowed where reading took too much memory."""
    limit = f"read within {limit_bytes >> 20} MiB of memory"
    return f"{limit} (read_memory_mib, --read-memory-mib, allows more; a larger voxel_size_m may need less)"


def content(path: Path) -> bytes:
    """Return all bytes of a file.

    Raises:
        RefusedError: It does not exist or is too large.
    """
    if not path.is_file():
        raise RefusedError(f"a map whose file {path.name} exists")
    if path.stat().st_size > MAX_FILE_BYTES:
        raise RefusedError(f"a map whose file {path.name} has at most {MAX_FILE_BYTES >> 30} GiB")
    return path.read_bytes()


def checked_shape(extent: Sequence[float] | np.ndarray) -> tuple[int, int, int]:
    """Return the shape that covers an extent (3,), in voxels; checked before an array of that size is made.

    Raises:
        RefusedError: It is not finite, or too many voxels.
    """
    edges = [float(edge) for edge in extent]
    if not all(math.isfinite(edge) and 0 <= edge <= MAX_VOXELS_ALONG_AXIS for edge in edges):
        raise RefusedError(f"a map of at most {MAX_VOXELS_ALONG_AXIS} voxels along each axis")
    x, y, z = (max(1, math.ceil(edge - 1e-6)) for edge in edges)
    if x * y * z > MAX_FILE_VOXELS:
        fewer = "a larger voxel_size_m has fewer"
        raise RefusedError(
            f"a map whose box holds at most {MAX_FILE_VOXELS} of its {x * y * z} voxels; {fewer}"
        )
    return x, y, z
