"""The bits that a scan from a viewpoint is expected to take from a robot's own map.

Rays go through the belief as those of a scan do, up to the first voxel that is believed covered. Where that
is too near for the sensor, they bring nothing. A ray goes on from a voxel with a probability:

- from an unknown one with 1 - `stop_probability`, or 1 - `gap_probability` where a voxel beside it is
  believed covered: rays that lie apart leave gaps in what they see of a wall; where something is predicted
  of it, with the probability that it is not solid;
- from a known one of expected coverage μ ≤ ½, where a wall was hit at a flat angle, with 1 - 2 μ; from the
  voxel in which it starts, it always does. So none gets beyond what is believed covered, whatever
  `voxels_behind` says.

What all rays add to a voxel counts once,

    I = Σ ½ log2(1 + Σ_rays w/σ(d)² / p),

with p the voxel's precision, d the ray's length and w the probability that it gets there (Rocha04, eqs. 5, 17
and 27). Of n scans from one place the sum over rays counts n times. Voxels that are left to teammates count
nothing. All places are in grid units; viewpoints are x, y, z, yaw, pitch. In all functions `belief` is a
Belief, `scan` a ScanModel and `scratch` a ScanScratch.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.measurement_model import measurement_precision
from entropy_explore_env.belief.raycast import OPEN, OPEN_END, STOP_AT_COVERED, Crossing, Line, cast_ray
from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.prediction.crop import UNPREDICTED

MOST_SCANS, _DOUBLINGS = 8, 3
_LEAST_SHARE = 1e-3
"""Rays that get on with less probability are not followed."""
_LEAST_GAIN = 1e-45
"""Precision that float32 still holds: what is added to a voxel is more than 0."""
_FOLD_ABOVE = 1e250
"""A product of ratios is folded into bits, by its logarithm, before it could leave a float64."""


class ScanModel(NamedTuple):
    """How a scan is imagined: with fewer rays than the sensor's."""

    yaws: np.ndarray
    """(columns,) radians from the gaze."""
    pitches: np.ndarray
    """(rows,) radians from the gaze."""
    sensor_rays: float
    """Rays of the sensor that each imagined ray stands for."""
    voxel_size_m: float
    max_range_m: float
    min_range_m: float
    sigma_min: float
    sigma_slope_per_m: float
    sigma_exponent: float
    voxels_behind: int
    known_precision: float
    """Voxels with less precision are unknown."""
    stop_probability: float
    """Probability that an unknown voxel stops a ray."""
    gap_probability: float
    """Probability that an unknown voxel beside a covered one stops a ray."""
    pose_variance: np.ndarray
    """(2,) float64: of the robot's place, summed over its axes, in squared voxel edges, and of its yaw, rad²;
    zeros = it knows its pose."""
    wanted_precision: float = math.inf
    """Voxels with at least this precision bring nothing that counts; inf = all voxels count."""


class ScanScratch(NamedTuple):
    """Memory to imagine scans of V voxels, rays across L of them, and R rows of rays."""

    added: np.ndarray
    """(V,) float32, zeros, which it is again afterwards."""
    touched: np.ndarray
    """(V + 1,) int32; the last is written, never read."""
    left: np.ndarray
    """(V,) uint8, zeros but while viewpoints are evaluated: not 0 = the voxel is left to teammates."""
    crossed: np.ndarray
    """(L,) int32, see `cast_ray`."""
    entered: np.ndarray
    """(L,) int64."""
    rows: np.ndarray
    """(R, 2) float64, cosine and sine of each row's pitch."""
    solid: np.ndarray
    """(V,) float32, predicted probability of each unknown voxel to stop a ray, or UNPREDICTED; (0,) = nothing
    is ever predicted."""
    scans: np.ndarray
    """(1,) int64, how many scans from one place are imagined at most: 1, 2, 4 or MOST_SCANS."""
    bits: np.ndarray
    """(4,) float64, what 1, 2, 4 and 8 of them should bring."""
    growth: np.ndarray
    """(4,) float64."""


def new_scan_scratch(voxels: int, longest_ray: int, rows: int, predicted: bool = False) -> ScanScratch:
    """Return memory for a grid, the most of its voxels that a ray crosses, and the most rows of rays.

    `predicted` says whether unknown voxels are ever predicted.
    """
    return ScanScratch(
        np.zeros(voxels, np.float32),
        np.zeros(voxels + 1, np.int32),
        np.zeros(voxels, np.uint8),
        np.zeros(longest_ray, np.int32),
        np.zeros(longest_ray, np.int64),
        np.zeros((rows, 2)),
        np.full(voxels if predicted else 0, UNPREDICTED, np.float32),
        np.ones(1, np.int64),
        np.zeros(1 + _DOUBLINGS),
        np.zeros(1 + _DOUBLINGS),
    )


@inlined_kernel
def _expected_precision(scan, length, direction):
    """Return the precision that a ray of the sensor should measure, less what the pose makes uncertain.

    1/σ² with σ² = σ(d)² + off, and off the mean square of how far the measured point is off in voxel edges,
    as `localization.weigh_by_covariance` fuses it, but for what place and yaw have in common.
    """
    range_m = length * scan.voxel_size_m
    precision = measurement_precision(range_m, scan.sigma_min, scan.sigma_slope_per_m, scan.sigma_exponent)
    place, yaw = scan.pose_variance[0], scan.pose_variance[1]
    if place > 0.0 or yaw > 0.0:
        lever = length * length * (direction[0] * direction[0] + direction[1] * direction[1])
        precision = precision / (1.0 + precision * (place + lever * yaw))
    return precision


@inlined_kernel
def _is_beside_covered(belief, voxel):
    """Return whether a voxel shares a face with one that is believed covered."""
    size, mean = belief.size, belief.mean
    x, y, z = grid_index(size, voxel)
    row, column = size[2], size[1] * size[2]
    return (
        (x > 0 and mean[voxel - column] > STOP_AT_COVERED)
        or (x < size[0] - 1 and mean[voxel + column] > STOP_AT_COVERED)
        or (y > 0 and mean[voxel - row] > STOP_AT_COVERED)
        or (y < size[1] - 1 and mean[voxel + row] > STOP_AT_COVERED)
        or (z > 0 and mean[voxel - 1] > STOP_AT_COVERED)
        or (z < size[2] - 1 and mean[voxel + 1] > STOP_AT_COVERED)
    )


@inlined_kernel
def _stop_probability(belief, scan, scratch, voxel):
    """Return the probability that an unknown voxel stops a ray."""
    if len(scratch.solid) > 0 and scratch.solid[voxel] >= 0.0:
        return np.float64(scratch.solid[voxel])
    gap = scan.gap_probability != scan.stop_probability and _is_beside_covered(belief, voxel)
    return scan.gap_probability if gap else scan.stop_probability


@inlined_kernel
def _touch(scratch, voxel, gain, count):
    """Add precision to a voxel, note it if it is the first that is added, and return how many are noted.

    It is always written down, and kept where it is the first: a branch that nothing predicts costs more. A
    gain of less than _LEAST_GAIN would be noted anew by every ray.
    """
    before = scratch.added[voxel]
    scratch.touched[np.uint32(count)] = voxel
    scratch.added[voxel] = before + gain
    return count + int(before == 0.0)


@inlined_kernel
def _imagine_ray(belief, scan, start, direction, count, scratch):
    """Add the precision that one ray should bring to `scratch.added`, and return the touched voxels."""
    length, n, end = cast_ray(
        belief.mean,
        belief.size,
        Line(start, direction, scan.max_range_m / scan.voxel_size_m),
        STOP_AT_COVERED,
        OPEN_END,
        scan.voxels_behind,
        Crossing(scratch.crossed, scratch.entered),
    )
    range_m = length * scan.voxel_size_m
    if end != OPEN and range_m < scan.min_range_m:
        return count
    share = 1.0
    gain = scan.sensor_rays * _expected_precision(scan, length, direction)
    if gain * _LEAST_SHARE < _LEAST_GAIN:
        return count
    for i in range(n):
        voxel = np.uint32(scratch.crossed[np.uint32(i)])
        if belief.precision[voxel] < scan.wanted_precision:
            count = _touch(scratch, voxel, gain * share, count)
        if belief.precision[voxel] < scan.known_precision:
            share *= 1.0 - _stop_probability(belief, scan, scratch, voxel)
        elif i > 0:
            share *= 1.0 - min(2.0 * belief.mean[voxel], 1.0)
        if share < _LEAST_SHARE:
            break
    return count


@lean_kernel
def imagine_scan(belief, scan, at, scratch):
    """Add the precision that a scan from a viewpoint (5,) should bring to `scratch.added`.

    The number of voxels in `scratch.touched` is returned.
    """
    start, count = (at[0], at[1], at[2]), 0
    for row in range(len(scan.pitches)):
        pitch = at[4] + scan.pitches[row]
        scratch.rows[row, 0], scratch.rows[row, 1] = math.cos(pitch), math.sin(pitch)
    for column in range(len(scan.yaws)):
        yaw = at[3] + scan.yaws[column]
        along, across = math.cos(yaw), math.sin(yaw)
        for row in range(len(scan.pitches)):
            level = scratch.rows[row, 0]
            direction = (along * level, across * level, -scratch.rows[row, 1])
            count = _imagine_ray(belief, scan, start, direction, count, scratch)
    return count


@lean_kernel
def expected_bits(belief, scan, at, scratch):
    """Return the bits that a scan from a viewpoint (5,) should bring.

    Voxels that are left to teammates are marked in `scratch.left` before: see `belief.visibility.mark_cones`.
    """
    count = imagine_scan(belief, scan, at, scratch)
    bits, growth = 0.0, 1.0
    for i in range(count):
        voxel = np.uint32(scratch.touched[np.uint32(i)])
        share = np.float64(scratch.added[voxel]) / np.float64(belief.precision[voxel])
        scratch.added[voxel] = 0.0
        growth *= 1.0 + (0.0 if scratch.left[voxel] else share)
        if growth > _FOLD_ABOVE:
            bits += math.log2(growth)
            growth = 1.0
    return 0.5 * (bits + math.log2(growth))


@lean_kernel
def fill_bits(belief, scan, at, scratch):
    """Fill in `scratch.bits`: what one scan from a viewpoint (5,) should bring, then what 2, 4, … should.

    Returns:
        How many of these are filled in, by `scratch.scans`.
    """
    bits, growth, filled = scratch.bits, scratch.growth, 1
    while 2**filled <= scratch.scans[0]:
        filled += 1
    if filled == 1:
        bits[0] = expected_bits(belief, scan, at, scratch)
        return filled
    count = imagine_scan(belief, scan, at, scratch)
    bits[:], growth[:] = 0.0, 1.0
    for i in range(count):
        voxel = np.uint32(scratch.touched[np.uint32(i)])
        share = np.float64(scratch.added[voxel]) / np.float64(belief.precision[voxel])
        scratch.added[voxel] = 0.0
        if scratch.left[voxel]:
            continue
        for n in range(filled):
            growth[n] *= 1.0 + share
            share *= 2.0
        if growth[filled - 1] > _FOLD_ABOVE:
            _fold(bits, growth)
    _fold(bits, growth)
    return filled


@inlined_kernel
def _fold(bits, growth):
    """Add the logarithms of the products of ratios to the bits, and begin new products."""
    for n in range(len(bits)):
        bits[n] += 0.5 * math.log2(growth[n])
        growth[n] = 1.0
