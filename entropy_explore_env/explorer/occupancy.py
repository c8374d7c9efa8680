"""Occupancy grids of other programs as expected coverage: percent, probabilities or log-odds."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, get_args

import numpy as np

from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.settings.grid import MAX_VOXELS
from entropy_explore_env.settings.validation import is_number

Values = Literal["percent", "probability", "log_odds"]
UNKNOWN_BETWEEN = (0.45, 0.55)
"""Probabilities from the first to the second are unknown: SLAM writes a half for what it never saw."""
_PERCENT_UNKNOWN = -1


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
