"""What a scan from a viewpoint is expected to show: known and unknown voxels in view, by their occupancy.

Rays go through the belief like those of a scan, until something believed covered; unknown voxels let them
through. Each voxel counts once. Places are in grid units.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.elevation import completed
from entropy_explore_env.belief.fields import Belief, occupancy_probability
from entropy_explore_env.belief.raycast import OPEN_END, STOP_AT_COVERED, Crossing, Line, cast_ray
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.sensor import RangeSensor

LEVELS = 20
"""Intervals of occupancy whose histograms are taken."""
_MIDDLES = (np.arange(LEVELS) + 0.5) / LEVELS
UNCERTAINTY = -(_MIDDLES * np.log2(_MIDDLES) + (1.0 - _MIDDLES) * np.log2(1.0 - _MIDDLES))
"""(LEVELS,) -(p log2 p + (1 - p) log2(1 - p)) in the middle of each interval of occupancy."""
_TOLERANCE = 0.01
"""Of the occupancy of unknown cells, as neighbours say it."""
_WHOLE_CELLS = 40_000
"""Plans with more cells than this, 200 × 200, are extrapolated no farther than can be seen: what the means of
neighbours take to settle grows with the third power of the width of a gap."""


class OccupancyMap(NamedTuple):
    """A robot's map as occupancies; V voxels."""

    belief: Belief
    occupancy: np.ndarray
    """(V,) float32, P(c > ½)."""
    unknown: np.ndarray
    """(V,) uint8, 1 = never measured."""
    interest: np.ndarray
    """(V,) float32, the interest function (Sujan, eq. 9)."""


class View(NamedTuple):
    """What is expected to be seen from one viewpoint, filled in by `look`, and working space for that."""

    shares: np.ndarray
    """(2, LEVELS) float64: number of known (row 0) and unknown (row 1) voxels in view by occupancy, each
    weighed by the interest in it."""
    counts: np.ndarray
    """(2,) int64: known and unknown voxels in view."""
    seen: np.ndarray
    """(V,) int32, the unknown voxels in view first."""
    stamps: np.ndarray
    """(V,) int32, number of the latest look that met each voxel."""
    looks: np.ndarray
    """(1,) int64, number of looks taken."""
    crossed: np.ndarray
    """(L,) int32, see `cast_ray`."""
    entered: np.ndarray
    """(L,) int64."""


def new_view(voxels: int, longest_ray: int) -> View:
    """Return an empty View of a grid, for rays that cross at most a number of its voxels."""
    return View(
        shares=np.zeros((2, LEVELS)),
        counts=np.zeros(2, np.int64),
        seen=np.zeros(voxels, np.int32),
        stamps=np.zeros(voxels, np.int32),
        looks=np.zeros(1, np.int64),
        crossed=np.zeros(longest_ray + 1, np.int32),
        entered=np.zeros(longest_ray + 1, np.int64),
    )


def occupancy_map(belief: Belief, prior_precision: float, interest: np.ndarray) -> OccupancyMap:
    """Return the occupancies of a belief; ½ where nothing is known.

    Args:
        belief: Of the robot.
        prior_precision: Precision of a voxel that was never measured.
        interest: (V,) float32, not copied.
    """
    occupancy, unknown = np.empty(len(belief.mean), np.float32), np.empty(len(belief.mean), np.uint8)
    _fill_occupancy(belief.mean, belief.precision, np.float32(prior_precision), occupancy, unknown)
    return OccupancyMap(belief, occupancy, unknown, interest)


def extrapolated(known: OccupancyMap, before: np.ndarray | None, reach: float) -> OccupancyMap:
    """Return a plan's map in which unknown cells have the mean occupancy of their neighbours (sect. 2.3.2).

    In 3-D they keep ½, and so do those of large plans that cannot be seen yet: in their rows or columns no
    known cell is within the sensor's reach.

    Args:
        known: Of `occupancy_map`.
        reach: Of the sensor, in voxel edges; inf allowed.
        before: (V,) float32 occupancies extrapolated for an earlier map, near which these are; None = none.
    """
    plan = known.belief.size[:2]
    if known.belief.size[2] > 1 or known.unknown.all():
        return known
    measured = (known.unknown == 0).reshape(plan)
    window = window_in_reach(measured, reach if measured.size > _WHOLE_CELLS else math.inf)
    begin = None if before is None else before.reshape(plan)[window]
    filled = known.occupancy.reshape(plan).copy()
    filled[window] = completed(filled[window], measured[window], _TOLERANCE, begin)
    return known._replace(occupancy=filled.reshape(-1))


def window_in_reach(measured: np.ndarray, reach: float) -> tuple[slice, slice]:
    """Return the rows and columns of (X, Y) cells that can be seen from measured ones, and one more.

    Args:
        measured: (X, Y) bool.
        reach: Of the sensor, in cells; inf allowed.
    """
    beyond = math.ceil(min(reach, sum(measured.shape))) + 1
    rows, columns = (np.flatnonzero(measured.any(axis=axis)) for axis in (1, 0))
    return (
        slice(max(int(rows[0]) - beyond, 0), int(rows[-1]) + beyond + 1),
        slice(max(int(columns[0]) - beyond, 0), int(columns[-1]) + beyond + 1),
    )


@lean_kernel
def _fill_occupancy(mean, precision, prior, occupancy, unknown):
    """Fill in P(c > ½) of each voxel, and whether it was never measured."""
    for voxel in range(len(mean)):
        unknown[voxel] = precision[voxel] <= prior
        if unknown[voxel]:
            occupancy[voxel] = 0.5
        else:
            occupancy[voxel] = occupancy_probability(np.float64(mean[voxel]), np.float64(precision[voxel]))


@lean_kernel
def look(known, scan, viewpoint, view):
    """Fill in what a scan from a viewpoint is expected to show.

    Args:
        known: OccupancyMap.
        scan: ScanModel, all rays of the sensor.
        viewpoint: (5,) x, y, z in grid units, yaw, pitch.
        view: View.
    """
    view.looks[0] += 1
    view.counts[0] = view.counts[1] = 0
    for level in range(LEVELS):
        view.shares[0, level] = view.shares[1, level] = 0.0
    start, belief = (viewpoint[0], viewpoint[1], viewpoint[2]), known.belief
    for column in range(len(scan.yaws)):
        yaw = viewpoint[3] + scan.yaws[column]
        for row in range(len(scan.pitches)):
            pitch = viewpoint[4] + scan.pitches[row]
            level = math.cos(pitch)
            direction = (math.cos(yaw) * level, math.sin(yaw) * level, -math.sin(pitch))
            end = cast_ray(
                belief.mean,
                belief.size,
                Line(start, direction, scan.max_range_m / scan.voxel_size_m),
                STOP_AT_COVERED,
                OPEN_END,
                max(scan.voxels_behind, 1),
                Crossing(view.crossed, view.entered),
            )
            for i in range(end.voxels):
                _count(known, view, view.crossed[i])


@inlined_kernel
def _count(known, view, voxel):
    """Count a voxel in view, unless this look has met it before."""
    if view.stamps[voxel] == view.looks[0]:
        return
    view.stamps[voxel] = view.looks[0]
    p, row = np.float64(known.occupancy[voxel]), np.int64(known.unknown[voxel])
    if row == 1:
        view.seen[view.counts[1]] = voxel
    view.counts[row] += 1
    view.shares[row, min(int(p * LEVELS), LEVELS - 1)] += known.interest[voxel]


def voxels_in_view(sensor: RangeSensor, grid: Grid) -> float:
    """Return the largest number of voxels that a sensor can see, N of eq. 8.

    Its view in a plan is a sector, else a part of a ball.
    """
    reach, (wide, high) = sensor.max_range_m / grid.voxel_size_m, sensor.field_of_view_rad
    if math.isinf(reach):
        return float(grid.voxels)
    inside = 0.5 * wide * reach**2 if grid.flat else wide * 2.0 * math.sin(0.5 * high) * reach**3 / 3.0
    return float(min(max(inside, 1.0), grid.voxels))


def new_information(shares: np.ndarray, most: float) -> float:
    """Return NI in bits of the histograms of a view (eq. 8).

        NI = Σ_known u(p_k)·(-q_k log2 q_k) + Σ_unknown u(p_k)·(-q_k log2 q_k)

    with q_k = n_k/N and u of `UNCERTAINTY`.

    Args:
        shares: (2, LEVELS) number of known and unknown voxels in each interval.
        most: N, the largest number of voxels in view.
    """
    q = np.minimum(shares / most, 1.0)
    return float((-q * np.log2(np.where(q > 0.0, q, 1.0)) * UNCERTAINTY).sum())
