"""Range sensors that fail: scans without measurements, lost rays, distances that are measured wrong."""

from __future__ import annotations

from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.compilation.kernels import lean_kernel, record_type
from entropy_explore_env.randomness import draw_uniform
from entropy_explore_env.robots.measured_rays import trace_measurement
from entropy_explore_env.robots.range_sensor import NEAREST

_NOTHING, _HIT = int(Return.NOTHING), int(Return.HIT)

FAULT_PARAMS = record_type(
    [
        # of its sensor
        ("lost_rays", "f8"),
        ("range_factor", "f8"),
        ("range_bias_m", "f8"),
        # of its radio
        ("garbled", "f8"),
        ("repeated", "f8"),
        ("late", "f8"),
        ("late_s", "f8"),
    ],
)
"""What is wrong with a robot all through a mission, in the units of `settings.faults`."""


@lean_kernel
def drop_ray(ray):
    """Let a ray have measured nothing."""
    ray.returned = _NOTHING
    ray.range_m = 0.0


@lean_kernel
def drop_scan(scan):
    """Let all rays of a scan have measured nothing."""
    for ray in scan.rays:
        drop_ray(ray)


@lean_kernel
def spoil_scan(scan, fault, params, scene, start, rng):
    """Lose rays of a scan, and measure the distances of its hits wrong.

    Args:
        scan: Scan as `take_scan` filled it in; changed in place.
        fault: FAULT_PARAMS of the robot.
        rng: (1,) uint64 random state; drawn from only where rays may be lost.

    Returns:
        How many rays were lost that would have measured something.
    """
    lost, wrong = 0, fault.range_factor != 1.0 or fault.range_bias_m != 0.0
    reach = params.max_range_m / scene.voxel_size_m
    for index in range(len(scan.rays)):
        ray = scan.rays[index]
        drawn = fault.lost_rays > 0.0 and draw_uniform(rng) < fault.lost_rays
        if ray.returned == _NOTHING:
            continue
        if drawn:
            drop_ray(ray)
            lost += 1
        elif wrong and ray.returned == _HIT:
            measured = (ray.range_m * fault.range_factor + fault.range_bias_m) / scene.voxel_size_m
            ray.length = min(max(measured, NEAREST), reach)
            trace_measurement(scan, index, params, scene.size, scene.voxel_size_m, start, scene.occupied)
            if ray.range_m < params.min_range_m:
                drop_ray(ray)
    return lost
