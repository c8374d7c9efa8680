"""What a planner expects of voxels that a robot never measured: a prediction in place of one probability.

Imagined rays pass an unknown voxel with the same probability everywhere (`recipe`), so a robot expects to see
into rock. Where much of what is unknown is predicted to be solid, they stop as predicted. Behind thin walls,
as in offices, that brings nothing, even with the true map in place of the prediction.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.planner.thresholds import (
    COURSE_DECISIONS,
    MOST_PREDICTED_VOXELS,
    RENEWED_DECISIONS,
    RENEWED_M,
    SOLID_SHARE,
    SOLID_SHARE_IN_VOLUMES,
    TO_AND_FRO,
)
from entropy_explore_env.prediction.crop import ROUNDING, UNPREDICTED
from entropy_explore_env.prediction.predictor import MapPredictor, Prediction
from entropy_explore_env.prediction.volumes import VOLUMES
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import sees_all_around

Foresight = Callable[[RobotView], np.ndarray | None]
"""What one robot knows → (V,) float32, of each voxel that is unknown to it the probability to stop a ray, or
UNPREDICTED; what it says of known voxels does not count. None = nothing is predicted."""


def predictions_pay(scenario: Scenario) -> bool:
    """Return whether predictions pay in missions that end when a map is known.

    They do if all robots decide at stops: in plans, ground robots that see all around; in volumes that are
    not too large, flying ones with a narrow view on planned paths. Missions that end when enough is seen took
    as long, even with the true map in place of the prediction; robots that decide under way turned back too
    often.
    """
    return not scenario.ending.by_seen and all(_pay_for(scenario, kind) for kind in scenario.kinds)


def _pay_for(scenario: Scenario, kind: RobotKind) -> bool:
    robot, around = kind.robot, sees_all_around(kind.sensor)
    if robot.redecide != "at_stop":
        return False
    if scenario.grid.flat:
        return robot.motion == "planar" and around
    small = scenario.grid.voxels <= MOST_PREDICTED_VOXELS
    return small and robot.motion == "free" and robot.navigator == "planned" and not around


class LearnedForesight:
    """What a predictor says of unknown voxels, in one mission; a Foresight.

    A robot's prediction is renewed as it moves on, and after some decisions on one spot; at every decision it
    took twice the time, and brought nothing. A robot that drives to and fro goes on without predictions:
    where those of one opening change with its place, it would do so for good.
    """

    def __init__(self, predictor: MapPredictor[Prediction | np.ndarray] | None = None) -> None:
        """Begin a mission; without a predictor, take that of the library for plans or for volumes."""
        self._predictor = predictor
        self._latest: dict[int, _Predicted] = {}
        self._courses: defaultdict[int, deque[np.ndarray]] = defaultdict(_new_course)
        """Robot number → (3,) x, y, z of where it was at its last decisions."""
        self._without: set[int] = set()
        """Robots that go on without predictions."""

    def __call__(self, view: RobotView) -> np.ndarray | None:
        """Return what was predicted last, or anew; a grid may grow from one decision to the next."""
        if self._goes_to_and_fro(view):
            self._without.add(view.robot)
        if view.robot in self._without:
            return None
        latest = self._latest.get(view.robot)
        if latest is None or latest.voxels != view.precision.size or latest.is_old(view.pose):
            solid, place_m = self._predicted(view), view.pose[:3].copy()
            latest = self._latest[view.robot] = _Predicted(place_m, view.precision.size, solid)
        latest.decisions += 1
        return latest.solid

    def _predicted(self, view: RobotView) -> np.ndarray | None:
        if self._predictor is not None:
            predicted = view.predicted_by(self._predictor)
        else:
            predicted = view.prediction if view.scenario.grid.flat else view.predicted_volume
        if isinstance(predicted, np.ndarray):
            return _solid_volume(view, predicted)
        return _solid_plan(view, predicted)

    def _goes_to_and_fro(self, view: RobotView) -> bool:
        """Return whether a robot drove far in its last decisions, and stayed in a small part of the world."""
        course = self._courses[view.robot]
        course.append(view.pose[:3].copy())
        places_m = np.array(course)
        driven_m = np.linalg.norm(np.diff(places_m, axis=0), axis=1).sum()
        across_m = np.linalg.norm(places_m.max(axis=0) - places_m.min(axis=0))
        long_enough = len(course) == COURSE_DECISIONS and across_m >= RENEWED_M
        return bool(long_enough and driven_m >= TO_AND_FRO * across_m)


def _new_course() -> deque[np.ndarray]:
    return deque(maxlen=COURSE_DECISIONS)


@dataclass
class _Predicted:
    """What was predicted for a robot."""

    place_m: np.ndarray
    """(3,) x, y, z of where it was."""
    voxels: int
    """Of the grid then."""
    solid: np.ndarray | None
    """What a Foresight says."""
    decisions: int = 0
    """Number of decisions that were made by it."""

    def is_old(self, pose: np.ndarray) -> bool:
        """Return whether the robot, which is at a pose now, needs another one."""
        moved_m = np.linalg.norm(pose[:3] - self.place_m)
        return bool(moved_m >= RENEWED_M or self.decisions >= RENEWED_DECISIONS)


def _solid_volume(view: RobotView, predicted: np.ndarray) -> np.ndarray | None:
    """Return what a Foresight says by (X, Y, Z) `RobotView.predicted_volume`."""
    held = predicted != UNPREDICTED
    if not held.any() or predicted[held].mean() < SOLID_SHARE_IN_VOLUMES:
        return None
    voxels = view.scenario.grid.voxel_size_m / VOLUMES.cell_m
    if voxels < 1.0:
        predicted = np.where(held, _stops(predicted, voxels), np.float32(UNPREDICTED))
    return predicted.reshape(-1)


def _stops(solid: np.ndarray, voxels: float) -> np.ndarray:
    """Return how probably a voxel stops a ray, of which one as large as a cell does with `solid`.

    `voxels` is the edge of a voxel over that of a cell: a ray across several voxels of a cell stops in one of
    them.
    """
    return 1.0 - (1.0 - solid) ** voxels


def _solid_plan(view: RobotView, prediction: Prediction) -> np.ndarray | None:
    grid = view.scenario.grid
    (columns, across), (rows, along) = (_cells(prediction, grid, axis) for axis in (0, 1))
    guess = prediction.solid[np.ix_(across, along)]
    unknown = view.precision[columns, rows, 0] <= view.scenario.sigma_prior**-2 * (1.0 + ROUNDING)
    if not unknown.any() or guess[unknown].mean() < SOLID_SHARE:
        return None
    solid = np.full(grid.shape, UNPREDICTED, np.float32)
    solid[columns, rows, 0] = _stops(guess, min(grid.voxel_size_m / prediction.cell_m, 1.0))
    return solid.reshape(-1)


def _cells(prediction: Prediction, grid: Grid, axis: int) -> tuple[slice, np.ndarray]:
    """Return the voxels along an axis whose centres a prediction holds, and the cells in which these lie."""
    centres_m = grid.origin_m[axis] + (np.arange(grid.shape[axis]) + 0.5) * grid.voxel_size_m
    cells = np.floor((centres_m - prediction.origin_m[axis]) / prediction.cell_m + ROUNDING).astype(np.int64)
    held = np.flatnonzero((cells >= 0) & (cells < prediction.solid.shape[axis]))
    first = int(held[0]) if len(held) else 0
    return slice(first, first + len(held)), cells[held]
