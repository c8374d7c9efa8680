"""Scans that come from outside: ranges along a sensor's rays, or points, fused into a belief.

They are traced through the belief's grid as measurements of teammates are, so that a scan which is given in
metres changes a belief as it did in the mission in which it was taken.
"""

from __future__ import annotations

import math

from entropy_explore_env.belief.map_update import fuse_scan
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.robots.measured_rays import trace_measurements
from entropy_explore_env.robots.range_sensor import NEAREST, point_rays, visibility_parameters

_NOTHING, _FREE, _HIT = int(Return.NOTHING), int(Return.FREE), int(Return.HIT)
_ROUNDING = 1e-9
"""A range that is shorter than the sensor's by no more than this share is the sensor's."""


@lean_kernel
def aim_at_points(rays, start_m, points_m, ranges_m):
    """Direct (R,) rays from a place (3,) at as many points (R, 3), and fill in their distances (R,)."""
    for index in range(len(rays)):
        ray, length = rays[index], 0.0
        for axis in range(3):
            ray.direction[axis] = points_m[index, axis] - start_m[axis]
            length += ray.direction[axis] ** 2
        length = math.sqrt(length)
        ranges_m[index] = length
        for axis in range(3):
            ray.direction[axis] /= max(length, 1e-12)
        ray.cos_pitch = math.sqrt(ray.direction[0] ** 2 + ray.direction[1] ** 2)


@lean_kernel
def fuse_given(scan, model, frame, pose, ranges_m, by_rays, mean, precision):
    """Fuse ranges into a belief, and return the bits that they brought.

    Args:
        scan: Scan of R rays; those of points are directed already. Utilities are filled in.
        frame: (size, voxel_size_m, start): voxels along each axis, their edge, the sensor in grid units.
        pose: (yaw, pitch) of the gaze, radians.
        ranges_m: (R,) float64: 0, or NaN, where nothing was measured; from the sensor's range on the ray met
            nothing within it.
        by_rays: Whether ranges are of the sensor's own rays.

    Returns:
        (bits, r̂, α̂): with mean distance and half-angle as of `visibility_parameters`.
    """
    size, edge_m, start = frame
    params = model.params[0]
    if by_rays:
        point_rays(model, pose[0], pose[1], scan.rays)
    for index in range(len(scan.rays)):
        ray, range_m = scan.rays[index], ranges_m[index]
        scan.order[index] = index
        ray.returned, ray.range_m, ray.length = _NOTHING, 0.0, 0.0
        if not range_m > 0.0:
            continue
        if range_m >= params.max_range_m * (1.0 - _ROUNDING):
            ray.returned, ray.length = _FREE, params.max_range_m / edge_m
        elif range_m >= params.min_range_m:
            ray.returned, ray.length = _HIT, max(range_m / edge_m, NEAREST)
    trace_measurements(scan, params, size, edge_m, start, mean)
    bits = fuse_scan(scan, len(scan.rays), mean, precision)
    depth_m, half_angle_rad, _ = visibility_parameters(scan.rays, pose[0], pose[1])
    return bits, depth_m, half_angle_rad
