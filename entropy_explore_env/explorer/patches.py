"""Maps that are given to an Explorer, as what is to be believed of a box of voxels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.errors import SettingError
from entropy_explore_env.explorer.occupancy import Occupancy
from entropy_explore_env.settings.scenario import Scenario

_KNOWN_SIGMA = 0.03
"""σ of what an occupancy grid says, unless the task asks for a finer one."""
_FINER = 0.99
"""What is known is known a little better than the task asks for, so that rounding does not matter."""
_SAME_SIZE = 1e-3
"""Share by which the size of voxels of a map may differ from what was asked for: float32 in messages."""


class Patch(NamedTuple):
    """A map that was given."""

    mean: np.ndarray
    """(X, Y, Z) float32 expected coverage."""
    precision: np.ndarray
    """(X, Y, Z) float32; that of the prior where nothing is known."""
    known: np.ndarray
    """(X, Y, Z) bool."""
    corner: tuple[float, float, float]
    """x, y, yaw in the map frame."""
    bottom_m: float
    """Height of the corner."""


def has_size(voxel_size_m: float, task: Scenario) -> bool:
    """Return whether voxels have the size of a task's."""
    return abs(voxel_size_m / task.grid.voxel_size_m - 1.0) <= _SAME_SIZE


def patch_of_map(given: Map, task: Scenario) -> Patch:
    """Return a Map as a patch of a task's belief.

    Raises:
        SettingError: Its voxels have another size.
    """
    if not has_size(given.grid.voxel_size_m, task):
        raise SettingError("grid", given, f"a map with voxels of {task.grid.voxel_size_m:g} m")
    (x, y, z), known, prior = given.grid.origin_m, given.known, np.float32(task.sigma_prior**-2)
    precision = np.where(known, np.maximum(given.precision, prior), prior)
    return Patch(given.mean, precision, known, (x, y, given.yaw_rad), z)


def patch_of_occupancy(
    occupancy: Occupancy, corner: tuple[float, float, float], bottom_m: float, task: Scenario
) -> Patch:
    """Return an occupancy grid as a patch of a task's belief: what it says is as certain as the task asks."""
    sigma = _FINER * min(_KNOWN_SIGMA, task.ending.sigma_end)
    precision = np.where(occupancy.known, np.float32(sigma**-2), np.float32(task.sigma_prior**-2))
    return Patch(occupancy.mean, precision, occupancy.known, corner, bottom_m)
