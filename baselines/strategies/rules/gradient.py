"""The strategy `gradient`: towards the steepest voxel entropy nearby (Rocha04, sect. 4, eqs. 30-40)."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.fields import entropy_gradient
from entropy_explore_env.compilation.kernels import kernel
from entropy_explore_env.frontiers.knowledge import RobotKnowledge, random_viewpoint
from entropy_explore_env.planner.driver import Driver, Trail

_REACH_TOLERANCE = 1e-6


class GradientStrategy(Driver):
    """Goes to the voxel within reach with the steepest entropy that is likely free; looks along the gradient.

    Free-flying robots follow eqs. 33-34, planar ones the projection on their motion plane, eqs.
    38-40. A robot wanders (a random viewpoint) where the chosen gradient vanishes, as the paper
    says, and where it is stuck: its latest drive was blocked, by a teammate or by what does not move.
    """

    rule = "gradient"
    most_blocked = 1

    def __init__(self, motion_plane: bool | None = None) -> None:
        """Take the rule.

        Args:
            motion_plane: Whether to project on the plane of the robot's gaze and its left (eqs.
                37-40, no roll); None = for planar robots only.
        """
        self._motion_plane = motion_plane

    def give_way(self, view: RobotKnowledge, trail: Trail) -> np.ndarray:
        """Wander (Rocha04, sect. 4)."""
        return random_viewpoint(view, self._rng)

    def decide(self, view: RobotKnowledge) -> np.ndarray | None:
        """Return the viewpoint (5,) by the robot's own belief; None where the gradient vanishes."""
        grid, robot = view.scenario.grid, view.kind.robot
        projected = view.planar if self._motion_plane is None else self._motion_plane
        position = grid.in_grid_units(view.pose)[:3]
        reach = min(robot.reach_m / grid.voxel_size_m, float(sum(grid.shape)))
        viewpoint = view.pose.copy()
        found = steepest_viewpoint(
            view.mean, view.precision, position, view.pose[3], view.pose[4], reach, projected, viewpoint
        )
        if not found:
            return None
        viewpoint[:3] = np.asarray(grid.origin_m) + viewpoint[:3] * grid.voxel_size_m
        if view.planar:
            viewpoint[2], viewpoint[4] = view.pose[2], 0.0
        return viewpoint


@kernel
def steepest_viewpoint(
    mean: np.ndarray,
    precision: np.ndarray,
    position: np.ndarray,
    yaw: float,
    pitch: float,
    reach: float,
    projected: bool,
    viewpoint: np.ndarray,
) -> bool:
    """Choose among the voxels within reach (Rocha04, eqs. 32-34, or 38-40 if projected).

        free-flying:  argmax ‖∇h(l)‖ (1 - μ_l),                     gaze along ∇h
        projected:    argmax ρ(pos, l) ‖proj ∇h(l)‖ (1 - μ_l),      gaze along proj ∇h

    Of equal voxels the first in C order is taken.

    Args:
        mean: (X, Y, Z) float32, expected coverage.
        precision: (X, Y, Z) float32, 1/σ².
        position: (3,) float64, the robot in grid units.
        yaw: Of the robot, radians.
        pitch: Of the robot, radians, downwards.
        reach: ξ in grid units.
        projected: Whether the robot's motion plane counts.
        viewpoint: (5,) float64, filled with the voxel's centre in grid units, yaw and pitch.

    Returns:
        Whether the gradient there is not zero; if it is, `viewpoint` is as it was.
    """
    ahead = (math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch))
    left = (-math.sin(yaw), math.cos(yaw), 0.0)
    best, found = 0.0, False
    low_x, high_x = _span(position[0], reach, mean.shape[0])
    low_y, high_y = _span(position[1], reach, mean.shape[1])
    low_z, high_z = _span(position[2], reach, mean.shape[2])
    for i in range(low_x, high_x):
        for j in range(low_y, high_y):
            for k in range(low_z, high_z):
                step = (i + 0.5 - position[0], j + 0.5 - position[1], k + 0.5 - position[2])
                length = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
                if length > reach * (1.0 + _REACH_TOLERANCE):
                    continue
                slope = entropy_gradient(precision, i, j, k, 1.0)
                reachable = 1.0
                if projected:
                    slope = _on_plane(slope, ahead, left)
                    if length > 0.0:
                        step = _on_plane(step, ahead, left)
                        reachable = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2) / length
                steepness = math.sqrt(slope[0] ** 2 + slope[1] ** 2 + slope[2] ** 2)
                score = reachable * steepness * (1.0 - mean[i, j, k])
                if score > best:
                    best, found = score, True
                    viewpoint[0], viewpoint[1], viewpoint[2] = i + 0.5, j + 0.5, k + 0.5
                    viewpoint[3] = (
                        yaw if slope[0] == 0.0 and slope[1] == 0.0 else math.atan2(slope[1], slope[0])
                    )
                    viewpoint[4] = -math.asin(min(max(slope[2] / steepness, -1.0), 1.0))
    return found


@kernel
def _span(position: float, reach: float, size: int) -> tuple[int, int]:
    """First and one past the last index along an axis whose voxel may be within reach."""
    return max(math.floor(position - reach), 0), min(math.floor(position + reach) + 1, size)


@kernel
def _on_plane(
    vector: tuple[float, float, float], ahead: tuple[float, float, float], left: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Projection on the robot's motion plane (Rocha04, eq. 37)."""
    along = vector[0] * ahead[0] + vector[1] * ahead[1] + vector[2] * ahead[2]
    across = vector[0] * left[0] + vector[1] * left[1] + vector[2] * left[2]
    return (
        along * ahead[0] + across * left[0],
        along * ahead[1] + across * left[1],
        along * ahead[2] + across * left[2],
    )
