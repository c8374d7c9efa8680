"""The strategy `gradient`: towards the steepest voxel entropy nearby (Rocha04, sect. 4, eqs. 30-40).

    free-flying:  argmax ‖∇h(l)‖ (1 - μ_l) over the voxels l within reach,   gaze along ∇h
    planar:       argmax ρ(l) ‖proj ∇h(l)‖ (1 - μ_l),                        gaze along proj ∇h

with h a voxel's entropy, μ its expected coverage, proj the projection on the plane of motion and ρ the share
of the way to l that lies in it.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.planner.driver import Driver, Trail
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.viewpoints.gradient_candidates import steepest_viewpoint


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
