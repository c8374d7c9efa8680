"""The part `panorama`: what rays around the robot would bring by its own belief, and how far they go."""

from __future__ import annotations

import math

from entropy_explore_env.belief.map_update import expected_utility
from entropy_explore_env.belief.measurement_model import measurement_precision
from entropy_explore_env.belief.raycast import OPEN, OPEN_END, STOP_AT_COVERED, Line, cast_ray, point
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.poses import grid_size


@lean_kernel
def observe_panorama(begin, params, sensor, directions, start, known, crossing, row):
    """Fill (2·D,): what rays around the robot would bring, cast like a scan through its own belief.

    Args:
        sensor: SENSOR_PARAMS of the robot.
        directions: (D, 3) float64 unit vectors.
    """
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out = row[begin:]
    count, size = len(directions), grid_size(params)
    reach = sensor.max_range_m / params.voxel_size_m
    for ray in range(count):
        line = Line(start, point(directions[ray]), reach)
        length, n, end = cast_ray(
            known.mean, size, line, STOP_AT_COVERED, OPEN_END, sensor.voxels_behind, crossing
        )
        range_m = sensor.max_range_m if end == OPEN else length * params.voxel_size_m
        measured = measurement_precision(
            range_m, sensor.sigma_min, sensor.sigma_slope_per_m, sensor.sigma_exponent
        )
        bits = expected_utility(known.precision, crossing.voxels, n, measured)
        if end != OPEN and range_m < sensor.min_range_m:
            bits = 0.0
        out[ray] = math.log2(1.0 + bits) if params.panorama_log else bits
        out[count + ray] = range_m
