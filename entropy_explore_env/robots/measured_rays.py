"""What measurements of known distance say of the voxels on their rays (Rocha04, eqs. 4-5).

Positions and lengths in grid units, ranges in metres.
"""

from __future__ import annotations

from entropy_explore_env.belief.measurement_model import Return, measured_coverage, measurement_precision
from entropy_explore_env.belief.raycast import NEVER_STOP, Crossing, Line, cast_ray, point
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

_NOTHING, _HIT = int(Return.NOTHING), int(Return.HIT)


@inlined_kernel
def weigh_measurement(scan, index, params, size, start, entered):
    """Fill in the measured coverage (eq. 4) of a ray that was cast, and its precision (eq. 5).

    Args:
        entered: (L,) int64, when the ray entered its voxels.
    """
    ray = scan.rays[index]
    ray.precision = measurement_precision(
        ray.range_m, params.sigma_min, params.sigma_slope_per_m, params.sigma_exponent
    )
    ray.free = ray.voxels
    if ray.returned == _HIT:
        crossing = Crossing(scan.crossed[index], entered)
        ray.free = measured_coverage(start, ray.length, size, crossing, ray.voxels, scan.coverage[index])


@lean_kernel
def trace_measurement(scan, index, params, size, voxel_size_m, start, coverage):
    """Fill in voxels and measured coverage of a measurement with a known distance.

    Args:
        scan: Holds direction, length and Return of the ray; the rest is filled in.
        coverage: (V,) float32, any map of the workspace; what it holds does not matter.
    """
    ray = scan.rays[index]
    ray.range_m = ray.length * voxel_size_m
    ray.voxels = cast_ray(
        coverage,
        size,
        Line(start, point(ray.direction), ray.length),
        NEVER_STOP,
        ray.returned == _HIT,
        params.voxels_behind,
        Crossing(scan.crossed[index], scan.entered),
    ).voxels
    weigh_measurement(scan, index, params, size, start, scan.entered)


@lean_kernel
def trace_measurements(scan, params, size, voxel_size_m, start, coverage):
    """Fill in what `trace_measurement` does for all rays that measured something."""
    for index in range(len(scan.rays)):
        if scan.rays[index].returned != _NOTHING:
            trace_measurement(scan, index, params, size, voxel_size_m, start, coverage)
