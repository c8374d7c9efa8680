"""A map as other programs take it: expected coverage and its σ in each voxel, and where it lies."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.validation import is_number
from entropy_explore_env.worlds.files.voxels import FREE, SOLID, UNKNOWN

_ROUNDING = 1e-6
"""A precision above the prior by less than this share is the prior."""


@dataclass(frozen=True, eq=False, repr=False)
class Map:
    """What a robot, or a team, believes of a world; a copy that later steps do not change.

    Attributes:
        grid: The voxels; `grid.origin_m` is the lower corner of voxel (0, 0, 0) in the map frame.
        mean: (X, Y, Z) float32, expected coverage, 0 to 1.
        precision: (X, Y, Z) float32, 1/σ² of it, > 0.
        sigma_prior: σ of a voxel that was never measured.
        yaw_rad: Rotation of the grid about its corner against the map frame, counter-clockwise.

    Maps compare by identity: to compare what they hold, compare their arrays.
    """

    grid: Grid
    mean: np.ndarray
    precision: np.ndarray
    sigma_prior: float
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        """Check the arrays and keep read-only copies of them."""
        for name in ("mean", "precision"):
            given = getattr(self, name)
            if not isinstance(given, np.ndarray) or given.shape != self.grid.shape:
                raise SettingError(f"Map.{name}", given, f"an array of shape {self.grid.shape}")
            kept = np.array(given, np.float32)
            kept.setflags(write=False)
            object.__setattr__(self, name, kept)
        if not (np.isfinite(self.mean).all() and self.mean.min() >= 0.0 and self.mean.max() <= 1.0):
            raise SettingError("Map.mean", self.mean, "numbers from 0 to 1")
        if not (np.isfinite(self.precision).all() and self.precision.min() > 0.0):
            raise SettingError("Map.precision", self.precision, "finite numbers > 0")
        if not is_number(self.sigma_prior) or not 0.0 < self.sigma_prior < math.inf:
            raise SettingError("Map.sigma_prior", self.sigma_prior, "a finite number > 0")
        if not is_number(self.yaw_rad) or math.isinf(self.yaw_rad):
            raise SettingError("Map.yaw_rad", self.yaw_rad, "a finite number")

    @property
    def sigma(self) -> np.ndarray:
        """(X, Y, Z) float32, standard deviation of coverage."""
        return np.asarray(1.0 / np.sqrt(self.precision), np.float32)

    @property
    def known(self) -> np.ndarray:
        """(X, Y, Z) bool, which voxels were measured at all."""
        return self.precision > np.float32(self.sigma_prior**-2) * np.float32(1.0 + _ROUNDING)

    def labels(self) -> np.ndarray:
        """(X, Y, Z) int8: FREE, SOLID or UNKNOWN; what was measured is covered above ½."""
        return np.where(self.known, np.where(self.mean > 0.5, SOLID, FREE), UNKNOWN).astype(np.int8)

    def __repr__(self) -> str:
        """Return its size and how much of it is known."""
        x, y, z = self.grid.shape
        share = float(self.known.mean())
        return f"Map({x} × {y} × {z} voxels of {self.grid.voxel_size_m:g} m, {share:.1%} known)"
