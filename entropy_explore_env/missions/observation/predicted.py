"""The part `prediction`: what a network predicts where nothing was measured, in cells around the robot."""

from __future__ import annotations

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.poses import grid_size
from entropy_explore_env.prediction.crop import FREE, SOLID, Belief, cell_at
from entropy_explore_env.prediction.predictor import predict_cells

PREDICTION_CHANNELS = 2


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
            out[cell] = predicting.solid[x, y]
            out[cells + cell] = 1.0 if told > 0.0 else 0.0
