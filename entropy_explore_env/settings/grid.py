"""The voxels of a workspace."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import check, check_counts, is_number

MAX_VOXELS = 2**31 - 1
"""Voxels are numbered by 32-bit integers."""
MAX_VOXELS_ALONG_AXIS = 2**20
"""Rays measure their way in 64-bit integers."""


@dataclass(frozen=True)
class Grid:
    """The voxels of a workspace. Frame: map, z up, metres (REP-103).

    Attributes:
        shape: Voxels along x, y and z; one along z is a 2-D world.
        voxel_size_m: Edge of a voxel (`vsz` of Rocha04).
        origin_m: Lower corner of voxel (0, 0, 0) in the map frame.
    """

    shape: tuple[int, int, int]
    voxel_size_m: float
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check every field."""
        check_counts(self, "shape", 1, MAX_VOXELS_ALONG_AXIS)
        if math.prod(self.shape) > MAX_VOXELS:
            raise SettingError("Grid.shape", self.shape, f"at most {MAX_VOXELS} voxels in all")
        check(self, "voxel_size_m", "a number from 1e-6 to 1e6", lambda v: 1e-6 <= v <= 1e6)
        finite = isinstance(self.origin_m, tuple) and len(self.origin_m) == 3
        if not finite or not all(is_number(v) and abs(v) <= 1e9 for v in self.origin_m):
            raise SettingError(
                "Grid.origin_m", self.origin_m, "a tuple of three numbers (x, y, z) from -1e9 to 1e9"
            )

    @property
    def voxels(self) -> int:
        """Number of voxels V = X·Y·Z."""
        return math.prod(self.shape)

    @property
    def flat(self) -> bool:
        """Whether the world is 2-D: one voxel high."""
        return self.shape[2] == 1

    @property
    def size_m(self) -> np.ndarray:
        """(3,) float64, extent along x, y and z in metres."""
        return np.asarray(self.shape) * self.voxel_size_m

    def voxel_of(self, position_m: np.ndarray) -> np.ndarray:
        """Return the indices (..., 3) int64 of the voxels that hold points (..., 3), map frame, metres."""
        scaled = (np.asarray(position_m) - np.asarray(self.origin_m)) / self.voxel_size_m
        return np.floor(scaled).astype(np.int64)

    def in_grid_units(self, pose: np.ndarray) -> np.ndarray:
        """Return a pose or viewpoint (N,), x, y, z first, its place in voxel edges from the lower corner."""
        converted = pose.copy()
        converted[:3] = (converted[:3] - np.asarray(self.origin_m)) / self.voxel_size_m
        return converted

    def centre_of(self, voxel: np.ndarray) -> np.ndarray:
        """Return the centres (..., 3) in metres, map frame, of the voxels with indices (..., 3)."""
        return np.asarray(self.origin_m) + (np.asarray(voxel) + 0.5) * self.voxel_size_m
