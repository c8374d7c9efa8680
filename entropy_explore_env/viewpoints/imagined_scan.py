"""What scans from viewpoints should bring, where walls have gaps: the bits of many viewpoints in one call.

As `expected_scan`, but for two things, without which rays are imagined to see through walls. An unknown voxel
beside something believed covered stops a ray with another, higher probability: rays that lie apart leave gaps
in what they see of a wall. And a known voxel with expected coverage μ ≤ ½, where a wall was hit at a flat
angle, stops a ray with probability 2 μ; the voxel in which it starts does not.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.raycast import OPEN, OPEN_END, STOP_AT_COVERED, Crossing, Line, cast_ray
from entropy_explore_env.belief.visibility import mark_cones
from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.viewpoints.expected_scan import expected_precision, fill_rows
from entropy_explore_env.viewpoints.gathered_bits import LEAST_GAIN, gathered_bits, touch

_LEAST_SHARE = 1e-3
"""Rays that get on with less probability are not followed."""


@inlined_kernel
def beside_covered(belief, voxel):
    """Whether a voxel shares a face with one that is believed covered."""
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
def _imagine_ray(belief, scan, gap_probability, start, direction, count, scratch):
    """Add the precision that one imagined ray should bring to `scratch.added`; returns the touched voxels."""
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
    gain = scan.sensor_rays * expected_precision(scan, length, direction)
    if gain * _LEAST_SHARE < LEAST_GAIN:
        return count
    for i in range(n):
        voxel = np.uint32(scratch.crossed[np.uint32(i)])
        if belief.precision[voxel] < scan.wanted_precision:
            count = touch(scratch, voxel, gain * share, count)
        if belief.precision[voxel] < scan.known_precision:
            gap = gap_probability != scan.stop_probability and beside_covered(belief, voxel)
            share *= 1.0 - (gap_probability if gap else scan.stop_probability)
        elif i > 0:
            share *= 1.0 - min(2.0 * belief.mean[voxel], 1.0)
        if share < _LEAST_SHARE:
            break
    return count


@lean_kernel
def imagine_scan(belief, scan, gap_probability, at, scratch, count):
    """Add the precision that a scan from a viewpoint should bring to `scratch.added`.

    Args:
        belief: A Belief.
        scan: A ScanModel.
        gap_probability: Probability that an unknown voxel beside a covered one stops a ray.
        at: (5,) x, y, z in grid units, yaw, pitch.
        scratch: A ScanScratch.
        count: How many voxels other scans have touched, to which this one adds.

    Returns:
        How many voxels are in `scratch.touched` then.
    """
    fill_rows(scan, at[4], scratch.rows)
    for column in range(len(scan.yaws)):
        yaw = at[3] + scan.yaws[column]
        along, across = math.cos(yaw), math.sin(yaw)
        for row in range(len(scan.pitches)):
            level = scratch.rows[row, 0]
            direction = (along * level, across * level, -scratch.rows[row, 1])
            start = (at[0], at[1], at[2])
            count = _imagine_ray(belief, scan, gap_probability, start, direction, count, scratch)
    return count


@lean_kernel
def imagined_bits(belief, scan, gap_probability, viewpoints, cones, scratch, bits):
    """Fill in the bits that a scan from each viewpoint should take from the robot's map.

    Args:
        belief: A Belief.
        scan: A ScanModel.
        gap_probability: Probability that an unknown voxel beside a covered one stops a ray.
        viewpoints: (K, 5) x, y, z in grid units, yaw, pitch.
        cones: (M,) CONE; voxels whose centres lie in one are left to teammates and count nothing.
        scratch: A ScanScratch.
        bits: (K,) float64, filled in.
    """
    mark_cones(cones, belief.size, scratch.left, 1)
    for k in range(len(viewpoints)):
        count = imagine_scan(belief, scan, gap_probability, viewpoints[k], scratch, 0)
        bits[k] = gathered_bits(belief, scratch, count)
    mark_cones(cones, belief.size, scratch.left, 0)
