"""The bits that a scan from a viewpoint is expected to take from a robot's own map."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.measurement_model import measurement_precision
from entropy_explore_env.belief.raycast import OPEN, OPEN_END, STOP_AT_COVERED, Crossing, Line, cast_ray
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.viewpoints.gathered_bits import LEAST_GAIN, gathered_bits, touch


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
    pose_variance: np.ndarray
    """(2,) float64: of the robot's place, summed over its axes, in squared voxel edges, and of its yaw, rad²;
    zeros = it knows its pose."""
    wanted_precision: float = math.inf
    """Voxels with at least so much precision bring nothing that counts; inf = all voxels count."""


class ScanScratch(NamedTuple):
    """Scratch space of `expected_scan_bits` for V voxels, rays across L of them, and R rows of rays."""

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


def new_scan_scratch(voxels: int, longest_ray: int, rows: int) -> ScanScratch:
    """Scratch space for a grid, rays that cross at most so many of its voxels, and at most so many rows."""
    return ScanScratch(
        np.zeros(voxels, np.float32),
        np.zeros(voxels + 1, np.int32),
        np.zeros(voxels, np.uint8),
        np.zeros(longest_ray, np.int32),
        np.zeros(longest_ray, np.int64),
        np.zeros((rows, 2)),
    )


@inlined_kernel
def fill_rows(scan, pitch, rows):
    """Fill in cosine and sine of the pitch of each row of rays, by the pitch of the gaze."""
    for row in range(len(scan.pitches)):
        rows[row, 0], rows[row, 1] = math.cos(pitch + scan.pitches[row]), math.sin(pitch + scan.pitches[row])


@inlined_kernel
def expected_precision(scan, length, direction):
    """Precision of the coverage that a ray of the sensor should measure, less what the pose makes uncertain.

    1/σ² with σ² = σ(d)² + off, and off the mean square of how far the measured point is off in voxel edges,
    as `localization.weigh_by_covariance` fuses it, but for what place and yaw have in common.

    Args:
        scan: A ScanModel.
        length: Of the ray, voxel edges.
        direction: (x, y, z), unit vector.
    """
    range_m = length * scan.voxel_size_m
    precision = measurement_precision(range_m, scan.sigma_min, scan.sigma_slope_per_m, scan.sigma_exponent)
    place, yaw = scan.pose_variance[0], scan.pose_variance[1]
    if place > 0.0 or yaw > 0.0:
        lever = length * length * (direction[0] * direction[0] + direction[1] * direction[1])
        precision = precision / (1.0 + precision * (place + lever * yaw))
    return precision


@lean_kernel
def expected_scan_bits(belief, scan, viewpoint, scratch):
    """Bits that a scan from a viewpoint is expected to take from the robot's map.

    Rays go through the belief like those of a scan, until something believed covered; where that is too near
    for the sensor, they bring nothing. A voxel that was never measured stops a ray with the probability
    `stop_probability`, so what lies behind counts for less. What all rays add to a voxel counts once,

        I = Σ ½ log2(1 + Σ_rays w/σ(d)² / p),

    with p the voxel's precision, d the ray's length and w the probability that it gets there (Rocha04, eqs.
    5, 17 and 27). Voxels that `scratch.left` marks are left to teammates, and count nothing.

    Args:
        belief: A Belief.
        scan: A ScanModel.
        viewpoint: (5,) x, y, z in grid units, yaw, pitch.
        scratch: A ScanScratch.

    Returns:
        Bits ≥ 0.
    """
    start, count = (viewpoint[0], viewpoint[1], viewpoint[2]), 0
    reach = scan.max_range_m / scan.voxel_size_m
    fill_rows(scan, viewpoint[4], scratch.rows)
    for column in range(len(scan.yaws)):
        yaw = viewpoint[3] + scan.yaws[column]
        along, across = math.cos(yaw), math.sin(yaw)
        for row in range(len(scan.pitches)):
            level = scratch.rows[row, 0]
            direction = (along * level, across * level, -scratch.rows[row, 1])
            length, n, end = cast_ray(
                belief.mean,
                belief.size,
                Line(start, direction, reach),
                STOP_AT_COVERED,
                OPEN_END,
                scan.voxels_behind,
                Crossing(scratch.crossed, scratch.entered),
            )
            range_m = length * scan.voxel_size_m
            if end != OPEN and range_m < scan.min_range_m:
                continue
            gain = scan.sensor_rays * expected_precision(scan, length, direction)
            if gain < LEAST_GAIN:
                continue
            for i in range(n):
                voxel = np.uint32(scratch.crossed[np.uint32(i)])
                count = touch(scratch, voxel, np.float32(gain), count)
                if belief.precision[voxel] < scan.known_precision:
                    gain *= 1.0 - scan.stop_probability
                    if gain < LEAST_GAIN:
                        break
    return gathered_bits(belief, scratch, count)
