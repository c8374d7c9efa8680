"""The strategy `gradient`: towards the steepest voxel entropy nearby (Rocha04, sect. 4, eqs. 30-40).

    free-flying:  argmax ‖∇h(l)‖ (1 - μ_l) over the voxels l within reach,   gaze along ∇h
    planar:       argmax ρ(l) ‖proj ∇h(l)‖ (1 - μ_l),                        gaze along proj ∇h

with h a voxel's entropy, μ its expected coverage, proj the projection on the plane of motion and ρ the share
of the way to l that lies in it.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.raycast import point
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.driver import Driver, Trail
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.viewpoints.gradient_candidates import dot, gradient_candidates, projection_on


class GradientStrategy(Driver):
    """Goes to the voxel within reach with the steepest entropy that is likely free; looks along the gradient.

    Free-flying robots follow eqs. 33-34, planar ones the projection on their motion plane, eqs.
    38-40. A robot wanders (a random viewpoint) where the chosen gradient vanishes, as the paper
    says, and where it is stuck: its latest drive did not arrive.
    """

    rule = "gradient"
    most_blocked = 0
    repeats = True

    def __init__(self, motion_plane: bool | None = None) -> None:
        """Take the rule.

        Args:
            motion_plane: Whether to project on the plane of the robot's gaze and its left (eqs.
                37-40, no roll); None = for planar robots only.
        """
        self._motion_plane = motion_plane

    def give_way(self, view: RobotKnowledge, trail: Trail) -> None:
        """Leave it to the rule, by which robots that are stuck wander."""

    def decide(self, view: RobotKnowledge) -> np.ndarray | None:
        """Return the viewpoint (5,) by the robot's own belief; None = the robot wanders."""
        if view.move_end not in (MoveEnd.ARRIVED, MoveEnd.UNDER_WAY):
            return None
        grid, robot = view.scenario.grid, view.kind.robot
        projected = view.planar if self._motion_plane is None else self._motion_plane
        position = grid.in_grid_units(view.pose)[:3]
        reach = min(robot.reach_m / grid.voxel_size_m, float(sum(grid.shape)))
        chosen = steepest(view.mean, view.precision, position, view.pose[3:].copy(), reach, projected)
        if chosen is None:
            return None
        place, gaze = chosen
        viewpoint = np.array([*(np.asarray(grid.origin_m) + place * grid.voxel_size_m), *gaze])
        if view.planar:
            viewpoint[2], viewpoint[4] = view.pose[2], 0.0
        return viewpoint


def steepest(
    mean: np.ndarray,
    precision: np.ndarray,
    position: np.ndarray,
    gaze: np.ndarray,
    reach: float,
    projected: bool,
) -> tuple[np.ndarray, tuple[float, float]] | None:
    """Return the place (3,) and the gaze (yaw, pitch) that the rule chooses; see the top of the file.

    Of equal voxels the first in C order is taken; None = the gradient is zero everywhere.

    Args:
        mean: (X, Y, Z) float32, expected coverage.
        precision: (X, Y, Z) float32, 1/σ².
        position: (3,) of the robot, grid units.
        gaze: (2,) yaw and pitch of the robot, which span its motion plane.
        reach: In voxel edges, finite.
        projected: Whether gradients and ways are projected on that plane.
    """
    candidates = gradient_candidates(precision, math.inf, position, reach, None)
    yaw, pitch = gaze.tolist()
    ahead = math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch)
    left = -math.sin(yaw), math.cos(yaw), 0.0
    best, (x, y, z), steepness = _best(candidates, mean, position, ahead, left, projected)
    if best < 0:
        return None
    yaw = math.atan2(y, x) if x != 0.0 or y != 0.0 else yaw
    return candidates[best]["place"], (yaw, -math.asin(min(max(z / steepness, -1.0), 1.0)))


@lean_kernel
def _best(candidates, mean, position, ahead, left, projected):
    """Return the number of the best of (K,) CANDIDATE, -1 = none is above zero; then ∇h there and ‖∇h‖."""
    best, highest, slope, steepness = -1, 0.0, (0.0, 0.0, 0.0), 0.0
    for number in range(len(candidates)):
        candidate = candidates[number]
        place, gradient = point(candidate.place), point(candidate.slope)
        norm, reachable = candidate.steepness, 1.0
        if projected:
            way = place[0] - position[0], place[1] - position[1], place[2] - position[2]
            gradient, along = projection_on(gradient, ahead, left), projection_on(way, ahead, left)
            norm = math.sqrt(dot(gradient, gradient))
            if candidate.distance > 0.0:
                reachable = math.sqrt(dot(along, along)) / candidate.distance
        uncovered = np.float32(1.0) - mean[int(place[0]), int(place[1]), int(place[2])]
        score = reachable * norm * np.float64(uncovered)
        if score > highest:
            best, highest, slope, steepness = number, score, gradient, norm
    return best, slope, steepness
