"""Maps that are given to an Explorer: occupancy grids of other programs, and what they let it believe."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple, get_args

import numpy as np

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.settings.grid import MAX_VOXELS
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import is_number
from entropy_explore_env.worlds.world import box_around

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
_AT_ONCE = 1 << 18
"""Voxels of a map that are turned into a belief at once, so that large maps take little memory."""


class Occupancies(NamedTuple):
    """A grid of occupancies in one of their forms."""

    grid: np.ndarray
    """(X, Y, Z)."""
    form: str
    """What its numbers are: "occupied", or one of `Values`."""
    unknown_between: tuple[float, float]

    def rows(self, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and known of the rows along x from `first` up to but without `last`, each (X, Y, Z).

        The mean is the expected coverage in float32, ½ where it is unknown.
        """
        array, (low, high) = self.grid[first:last], self.unknown_between
        if self.form == "occupied":
            return array.astype(np.float32), np.ones(array.shape, np.bool_)
        if self.form == "percent":
            known, mean = array != _PERCENT_UNKNOWN, (array * np.float32(0.01)).astype(np.float32)
        else:
            known = ~np.isnan(array)
            mean = np.where(known, array, 0.0).astype(np.float32)
            if self.form == "log_odds":
                mean = np.reciprocal(1.0 + np.exp(np.clip(-mean, -80.0, 80.0)), dtype=np.float32)
        known &= (mean < low) | (mean > high)
        mean[~known] = 0.5
        return mean, known


def occupancies_of(
    grid: object, values: Values | None = None, unknown_between: tuple[float, float] = UNKNOWN_BETWEEN
) -> Occupancies:
    """Return an occupancy grid with the form of its numbers.

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
    between = _checked_between(unknown_between)
    if array.dtype.kind == "b":
        return Occupancies(array, "occupied", between)
    form = values or ("probability" if array.dtype.kind == "f" else "percent")
    if form not in get_args(Values):
        raise SettingError("values", values, one_of(values, get_args(Values)))
    if form == "percent":
        _check_percents(array, values)
    elif form == "probability":
        least, most = np.fmin.reduce(array, axis=None), np.fmax.reduce(array, axis=None)  # NaN is unknown
        if least < 0.0 or most > 1.0:
            allowed = "probabilities from 0 to 1; others with values='log_odds' or 'percent'"
            raise SettingError("grid", f"{least:g} … {most:g}", allowed)
    return Occupancies(array, form, between)


def _checked_between(between: object) -> tuple[float, float]:
    """Return the two limits of what is unknown."""
    allowed = "two numbers from 0 to 1, with ½ between them"
    if not isinstance(between, tuple) or len(between) != 2 or not all(is_number(v) for v in between):
        raise SettingError("unknown_between", between, allowed)
    low, high = between
    if not 0.0 <= low <= 0.5 <= high <= 1.0:
        raise SettingError("unknown_between", between, allowed)
    return float(low), float(high)


def _check_percents(array: np.ndarray, values: str | None) -> None:
    """Raise a SettingError unless numbers are percents."""
    if array.dtype.kind == "f" and not (np.isfinite(array).all() and (array == np.rint(array)).all()):
        raise SettingError("grid", array, "whole numbers where values are percent")
    least, most = array.min(), array.max()
    if least < _PERCENT_UNKNOWN or most > 100:
        raise SettingError("grid", f"{least} … {most}", "percents from 0 to 100, or -1 for unknown")
    if values is None and most == 1:
        allowed = "booleans, or values='percent' if it is 1 % that is meant"
        raise SettingError("grid", "whole numbers of which 1 is the largest", allowed)


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

    given: Occupancies | Map
    box: tuple[np.ndarray, np.ndarray] | None
    """First voxel (3,) int64 of the box of what is known, and the one past its last; None = nothing is."""
    corner: tuple[float, float, float]
    """x, y, yaw in the map frame."""
    bottom_m: float
    """Height of the corner."""
    precisions: tuple[np.float32, np.float32]
    """That of the prior, where nothing is known, and that of what an occupancy grid says."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(X, Y, Z)."""
        return self.given.mean.shape if isinstance(self.given, Map) else self.given.grid.shape

    def parts(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Yield the map in blocks of rows along x: index of the first row, mean and precision.

        Arrays are (X, Y, Z) float32.
        """
        prior, told = self.precisions
        for first, last in _rows(self.shape):
            if isinstance(self.given, Map):
                mean, precision = self.given.mean[first:last], self.given.precision[first:last]
                known = self.given.known[first:last]
                yield first, mean, np.where(known, np.maximum(precision, prior), prior)
            else:
                mean, known = self.given.rows(first, last)
                yield first, mean, np.where(known, told, prior)


def _rows(shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """Yield the blocks of rows along x in which an (X, Y, Z) map is read: their first row and the end."""
    at_once = max(1, _AT_ONCE // (shape[1] * shape[2]))
    for first in range(0, shape[0], at_once):
        yield first, min(first + at_once, shape[0])


def box_of(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the first voxel (3,) int64 of a mask's box, and the one past its last; None = it is empty."""
    if not mask.any():
        return None
    box = box_around(mask)
    low, high = [part.start for part in box], [part.stop for part in box]
    return np.array(low, np.int64), np.array(high, np.int64)


def _known_box(given: Occupancies) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the box of what is known of a grid, block by block: see `Patch`."""
    low, high = np.array(given.grid.shape), np.zeros(3, np.int64)
    for first, last in _rows(given.grid.shape):
        box = box_of(given.rows(first, last)[1])
        if box is not None:
            at = np.array([first, 0, 0])
            low, high = np.minimum(low, box[0] + at), np.maximum(high, box[1] + at)
    return (low, high) if high.any() else None


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
    (x, y, z), prior = given.grid.origin_m, np.float32(task.sigma_prior**-2)
    return Patch(given, box_of(given.known), (x, y, given.yaw_rad), z, (prior, prior))


def patch_of_occupancies(
    given: Occupancies, corner: tuple[float, float, float], bottom_m: float, task: Scenario
) -> Patch:
    """Return an occupancy grid as a patch of a task's belief: what it says is as certain as the task asks."""
    sigma = _FINER * min(_KNOWN_SIGMA, task.ending.sigma_end)
    precisions = np.float32(task.sigma_prior**-2), np.float32(sigma**-2)
    return Patch(given, _known_box(given), corner, bottom_m, precisions)


def numbers_of(measured: object) -> np.ndarray:
    """Return what a scan measured as a float64 array.

    Raises:
        SettingError: It holds something else than numbers.
    """
    try:
        given = np.asarray(measured)
    except (TypeError, ValueError, RuntimeError):  # lists of different lengths, tensors with gradients
        given = np.asarray(None)
    if given.dtype.kind not in "fiu":
        allowed = "numbers: ranges (R,), or points (N, 3), as of sensor_msgs_py's read_points_numpy"
        raise SettingError("measured", measured, allowed)
    return given.astype(np.float64)
