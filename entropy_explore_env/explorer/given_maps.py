"""Maps that are given to an Explorer: occupancy grids of other programs, and what they let it believe."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, get_args

import numpy as np

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.settings.grid import MAX_VOXELS
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import is_number

Values = Literal["percent", "probability", "log_odds"]
UNKNOWN_BETWEEN = (0.45, 0.55)
"""Probabilities from the first to the second are unknown: SLAM writes a half for what it never saw."""
_PERCENT_UNKNOWN = -1
_KNOWN_SIGMA = 0.03
"""σ of what an occupancy grid says, unless the task asks for a finer one."""
_FINER = 0.99
"""What is known is known a little better than the task asks for, so that rounding does not matter."""
_SAME_SIZE = 1e-3
"""Share by which the size of voxels of a map may differ from what was asked for: float32 in messages."""


class Occupancy(NamedTuple):
    """A grid of occupancies as coverage."""

    mean: np.ndarray
    """(X, Y, Z) float32 expected coverage; ½ where it is unknown."""
    known: np.ndarray
    """(X, Y, Z) bool."""


def occupancy_of(
    grid: object, values: Values | None = None, unknown_between: tuple[float, float] = UNKNOWN_BETWEEN
) -> Occupancy:
    """Return the expected coverage of an occupancy grid.

    Args:
        grid: (X, Y) or (X, Y, Z). Whole numbers are percent, with -1 for unknown, as in ROS's OccupancyGrid;
            floats are probabilities, with NaN for unknown; booleans say occupied or free.
        values: What the numbers are, where their type does not say it.
        unknown_between: Probabilities from the first to the second are unknown, too.

    Raises:
        SettingError: The grid is no such array, or holds values that its form does not allow.
    """
    array = grid if isinstance(grid, np.ndarray) else np.asarray(None)
    if array.ndim not in (2, 3) or array.dtype.kind not in "biuf" or not 0 < array.size <= MAX_VOXELS:
        raise SettingError("grid", grid, "a NumPy array (X, Y) or (X, Y, Z) of numbers")
    array = array[:, :, None] if array.ndim == 2 else array
    low, high = _checked_between(unknown_between)
    if array.dtype.kind == "b":
        return Occupancy(array.astype(np.float32), np.ones(array.shape, np.bool_))
    form = values or ("probability" if array.dtype.kind == "f" else "percent")
    if form not in get_args(Values):
        raise SettingError("values", values, one_of(values, get_args(Values)))
    mean, known = _percent(array, values) if form == "percent" else _probabilities(array, form)
    known &= (mean < low) | (mean > high)
    mean[~known] = 0.5
    return Occupancy(mean, known)


def _checked_between(between: object) -> tuple[float, float]:
    """Return the two limits of what is unknown."""
    allowed = "two numbers from 0 to 1, with ½ between them"
    if not isinstance(between, tuple) or len(between) != 2 or not all(is_number(v) for v in between):
        raise SettingError("unknown_between", between, allowed)
    low, high = between
    if not 0.0 <= low <= 0.5 <= high <= 1.0:
        raise SettingError("unknown_between", between, allowed)
    return float(low), float(high)


def _percent(array: np.ndarray, values: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and known of percents; -1 = unknown."""
    if array.dtype.kind == "f" and not (np.isfinite(array).all() and (array == np.rint(array)).all()):
        raise SettingError("grid", array, "whole numbers where values are percent")
    least, most = array.min(), array.max()
    if least < _PERCENT_UNKNOWN or most > 100:
        raise SettingError("grid", f"{least} … {most}", "percents from 0 to 100, or -1 for unknown")
    if values is None and most == 1:
        allowed = "booleans, or values='percent' if it is 1 % that is meant"
        raise SettingError("grid", "whole numbers of which 1 is the largest", allowed)
    return (array * np.float32(0.01)).astype(np.float32), array != _PERCENT_UNKNOWN


def _probabilities(array: np.ndarray, form: str) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and known of probabilities or log-odds; NaN = unknown."""
    known = ~np.isnan(array)
    mean = np.where(known, array, 0.0).astype(np.float32)
    if form == "log_odds":
        mean = np.reciprocal(1.0 + np.exp(np.clip(-mean, -80.0, 80.0)), dtype=np.float32)
    elif mean.min() < 0.0 or mean.max() > 1.0:
        found = f"{mean.min():g} … {mean.max():g}"
        raise SettingError(
            "grid", found, "probabilities from 0 to 1; others with values='log_odds' or 'percent'"
        )
    return mean, known


def checked_origin(origin: object) -> tuple[float, float, float]:
    """Return the corner (x, y, yaw) of a grid.

    Raises:
        SettingError: It is not three finite numbers.
    """
    given = origin if isinstance(origin, tuple | list | np.ndarray) else ()
    if len(given) != 3 or not all(is_number(v) and abs(v) <= 1e9 for v in given):
        raise SettingError("origin", origin, "three finite numbers (x, y, yaw), metres and radians")
    x, y, yaw = (float(v) for v in given)
    return x, y, math.remainder(yaw, 2.0 * math.pi)


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
