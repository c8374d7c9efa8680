"""The belief that an Explorer plans in: a grid around what is known, which grows with the map.

Its frame is the map frame, turned by the yaw of the map's grid: x and y run along the grid's axes. Around
what is known lies a margin of unknown voxels, since a planner takes the grid's boundary for a wall.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.belief.map_update import PRIOR_MEAN
from entropy_explore_env.settings.grid import Grid

_ON_LATTICE = 0.01
"""Two grids share a lattice whose corners differ from whole voxels by no more than this, in voxel edges."""


class Canvas:
    """A belief in a grid.

    Attributes:
        grid: The voxels, in the canvas's frame.
        yaw_rad: Rotation of that frame against the map frame.
        prior_precision: Precision of voxels of which nothing is known.
        mean, precision: (X, Y, Z) float32.
    """

    def __init__(self, grid: Grid, yaw_rad: float, prior_precision: float | np.float32) -> None:
        """Begin with nothing known."""
        self.grid, self.yaw_rad, self.prior_precision = grid, yaw_rad, np.float32(prior_precision)
        self.mean = np.full(grid.shape, PRIOR_MEAN, np.float32)
        self.precision = np.full(grid.shape, prior_precision, np.float32)

    def offset_of(self, corner: np.ndarray) -> np.ndarray | None:
        """Return the voxel (3,) int64 at which a grid's corner lies, in this frame; None = between voxels."""
        edges = (corner - np.asarray(self.grid.origin_m)) / self.grid.voxel_size_m
        whole = np.rint(edges)
        return whole.astype(np.int64) if np.abs(edges - whole).max() <= _ON_LATTICE else None

    def holds(self, low: np.ndarray, high: np.ndarray) -> bool:
        """Return whether the voxels from `low` up to but without `high`, each (3,), lie in the grid."""
        return bool((low >= 0).all() and (high <= self.grid.shape).all())

    @property
    def known(self) -> np.ndarray:
        """(X, Y, Z) bool, which voxels were measured or are known from a map."""
        return np.asarray(self.precision > self.prior_precision)

    def grown(self, low: np.ndarray, high: np.ndarray) -> Canvas:
        """Return a canvas of the voxels from `low` up to `high` of this lattice that knows the same."""
        grid = self.grid
        origin = np.asarray(grid.origin_m) + low * grid.voxel_size_m
        bigger = Canvas(grid_of(high - low, grid.voxel_size_m, origin), self.yaw_rad, self.prior_precision)
        first, last = np.maximum(low, 0), np.minimum(high, grid.shape)
        mine = tuple(slice(a, max(a, b)) for a, b in zip(first, last, strict=True))
        theirs = tuple(slice(a, max(a, b)) for a, b in zip(first - low, last - low, strict=True))
        bigger.mean[theirs], bigger.precision[theirs] = self.mean[mine], self.precision[mine]
        return bigger


def grid_of(shape: np.ndarray, voxel_size_m: float, origin_m: np.ndarray) -> Grid:
    """Return a Grid from arrays (3,).

    Raises:
        SettingError: It would have too many voxels.
    """
    x, y, z = (int(n) for n in shape)
    at = (float(origin_m[0]), float(origin_m[1]), float(origin_m[2]))
    return Grid((x, y, z), voxel_size_m, at)
