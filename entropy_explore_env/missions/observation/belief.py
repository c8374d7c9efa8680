"""The parts of an observation that show a robot's belief.

`patch` around the robot, `overview` of the whole map, `panorama` along rays, `prediction` of unseen cells.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.map_update import expected_utility
from entropy_explore_env.belief.measurement_model import measurement_precision
from entropy_explore_env.belief.pooling import normalised_entropy
from entropy_explore_env.belief.raycast import OPEN, OPEN_END, STOP_AT_COVERED, Line, cast_ray, point
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.poses import grid_size
from entropy_explore_env.prediction.crop import FREE, SOLID, Belief, cell_at
from entropy_explore_env.prediction.predictor import predict_cells

PATCH_CHANNELS = 4
OVERVIEW_CHANNELS = 2
PREDICTION_CHANNELS = 2


@lean_kernel
def observe_patch(begin, params, shape, robot, start, known, row):
    """Fill (4·x·y·z,): the belief around the robot's voxel; outside the workspace it is covered.

    Args:
        shape: (x, y, z) voxels of the patch.
    """
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out = row[begin:]
    size = grid_size(params)
    prior, end = params.prior_precision, params.end_precision
    cells = shape[0] * shape[1] * shape[2]
    corner_x = math.floor(start[0]) - shape[0] // 2
    corner_y = math.floor(start[1]) - shape[1] // 2
    corner_z = math.floor(start[2]) - shape[2] // 2
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                cell = flat_index(shape, i, j, k)
                x, y, z = corner_x + i, corner_y + j, corner_z + k
                inside = 0 <= x < size[0] and 0 <= y < size[1] and 0 <= z < size[2]
                voxel = flat_index(size, x, y, z) if inside else 0
                out[cell] = known.mean[voxel] if inside else 1.0
                out[cells + cell] = (
                    normalised_entropy(prior, end, np.float64(known.precision[voxel])) if inside else 0.0
                )
                out[2 * cells + cell] = 0.0 if inside else 1.0
                out[3 * cells + cell] = 0.0
    for mate in range(len(known.heard)):
        if mate != robot and known.heard[mate].heard_s >= 0.0:
            there, low = known.heard[mate].pose, params.origin_m
            x = math.floor((there[0] - low[0]) / params.voxel_size_m) - corner_x
            y = math.floor((there[1] - low[1]) / params.voxel_size_m) - corner_y
            z = math.floor((there[2] - low[2]) / params.voxel_size_m) - corner_z
            if 0 <= x < shape[0] and 0 <= y < shape[1] and 0 <= z < shape[2]:
                out[3 * cells + flat_index(shape, x, y, z)] = 1.0


@lean_kernel
def observe_overview(begin, cells, sums, row):
    """Fill (2·C,): normalised entropy and expected coverage, means over Cells, from (2, C) sums."""
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out = row[begin:]
    count = len(cells.voxels)
    for cell in range(count):
        out[cell] = min(max(sums[0, cell] / cells.voxels[cell], 0.0), 1.0)
        out[count + cell] = min(max(sums[1, cell] / cells.voxels[cell], 0.0), 1.0)


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


@lean_kernel
def observe_prediction(begin, params, shape, start, known, predicting, row):
    """Fill (2·x·y,): the probability of cells to be solid, and 1 where something was measured.

    Args:
        shape: (x, y) cells, the robot's own in the middle.
        start: Where the robot is, in grid units.
        predicting: Predicting.
    """
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out, cells = row[begin:], shape[0] * shape[1]
    belief = Belief(
        grid_size(params), params.voxel_size_m, params.prior_precision, known.mean, known.precision
    )
    radius = params.body_radius_m / params.voxel_size_m
    window = predict_cells(predicting, belief, start, radius)
    corner_x = cell_at(belief, start[0]) - window.x - shape[0] // 2
    corner_y = cell_at(belief, start[1]) - window.y - shape[1] // 2
    for i in range(shape[0]):
        for j in range(shape[1]):
            x, y, cell = corner_x + i, corner_y + j, i * shape[1] + j
            told = predicting.cells[SOLID, x, y] + predicting.cells[FREE, x, y]
            out[cell] = predicting.solid[0, x, y]
            out[cells + cell] = 1.0 if told > 0.0 else 0.0
