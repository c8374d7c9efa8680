"""Observations of robots, put together from their parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.localization import believed_pose, estimate_in
from entropy_explore_env.missions.observation.belief import (
    observe_overview,
    observe_panorama,
    observe_patch,
    observe_prediction,
)
from entropy_explore_env.missions.observation.mask import observe_mask
from entropy_explore_env.missions.observation.robots import observe_drive, observe_self, observe_team
from entropy_explore_env.missions.poses import pose_at, speed_at, within_grid


class Known(NamedTuple):
    """What one robot knows, as its observation is made from it."""

    pose: tuple[float, float, float, float, float]
    """x, y, z, yaw, pitch, as the robot believes it to be."""
    time_s: float
    entropy_bits: float
    """Entropy of its map."""
    deciding: bool
    speed_m_s: float
    target: np.ndarray
    """(5,) the viewpoint that it chose last."""
    heard: np.ndarray
    """(A,) HEARD, what it heard of each teammate."""
    mean: np.ndarray
    """(V,) float32, its expected coverage."""
    precision: np.ndarray
    """(V,) float32, 1/σ² of it."""
    pooled: np.ndarray
    """(2, C) float64, sums over the cells of the overview."""


class Observed(NamedTuple):
    """What observations of E missions are made from: arrays of MissionState."""

    missions: np.ndarray
    """(E,) MISSION."""
    robots: np.ndarray
    """(E, A) ROBOT."""
    heard: np.ndarray
    """(E, A, A) HEARD."""
    mean: np.ndarray
    """(E, A, V) float32."""
    precision: np.ndarray
    """(E, A, V) float32."""
    pooled: np.ndarray
    """(E, A, 2, C) float64."""
    estimates: np.ndarray | None
    """(E, A) ESTIMATE; None = all robots know where they are."""


@lean_kernel
def observe_robot(rules, offsets, robot, known, crossing, predicting, out):
    """Fill the flat observation of one robot.

    Args:
        predicting: Predicting; None = no prediction is observed, and nothing of it is compiled.
        out: (F,) float32, filled in.
    """
    params, sensor = rules.params[robot], rules.sensors.params[robot]
    start = within_grid(params, known.pose)
    observe_panorama(offsets.panorama, params, sensor, rules.panorama, start, known, crossing, out)
    observe_self(offsets.self_state, params, offsets.kinds, known, out)
    observe_drive(offsets.drive, params, known, out)
    observe_team(offsets.team, params, robot, known, out)
    observe_patch(offsets.patch, params, offsets.patch_shape, robot, start, known, out)
    observe_overview(offsets.overview, rules.cells, known.pooled, out)
    observe_prediction(offsets.prediction, params, offsets.prediction_shape, start, known, predicting, out)
    observe_mask(offsets.action_mask, params, rules.actions, start, known.mean, out)


@lean_kernel
def observe_missions(rules, offsets, observed, crossing, predicting, first, last, out):
    """Fill the flat observations of missions' robots, each from where it is now.

    Args:
        predicting: As in `observe_robot`.
        out: (E, A, F) float32, filled in.
    """
    for mission in range(first, last):
        clock = observed.missions[mission]
        for robot in range(observed.robots.shape[1]):
            own, row = observed.robots[mission, robot], out[mission, robot]
            if not (offsets.while_busy or own.deciding or clock.end != 0):
                for place in range(len(row)):
                    row[place] = 0.0
                continue
            pose = pose_at(rules.params[robot], own, clock.time_s)
            known = Known(
                believed_pose(estimate_in(observed.estimates, mission, robot), rules.params[robot], pose),
                clock.time_s,
                own.entropy_bits,
                own.deciding,
                0.0 if offsets.drive is None else speed_at(rules.params[robot], own, clock.time_s),
                own.target,
                observed.heard[mission, robot],
                observed.mean[mission, robot],
                observed.precision[mission, robot],
                observed.pooled[mission, robot],
            )
            observe_robot(rules, offsets, robot, known, crossing, predicting, row)
