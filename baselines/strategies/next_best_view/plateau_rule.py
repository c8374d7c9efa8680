"""Rules that map from a plateau with a rover that must not drive over its edge; a subclass chooses the poses.

A rover begins by looking at the ground all around it. Ours: it drives only where all of its body, and a
column more, stands on columns that were measured, or on which it stood before. One that a teammate stopped,
or that is blocked, chooses anew: a random viewpoint may lie beyond the edge.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import cast

import numpy as np

from baselines.strategies.next_best_view.ground_map import EdgeForm, GroundMap
from baselines.strategies.next_best_view.poses import path_points, reachable_voxels, yaws_around
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.knowledge import voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.planner.driver import Driver, Trail
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.scenario import Scenario

STEEP_RAD = math.radians(60.0)
"""Poses look down by at most this, and so does the first look around."""
_SAME_PLACE = 0.75
"""Voxel edges: a rover this near has arrived."""


@dataclass
class Rover:
    """What is kept of a rover from one decision to the next."""

    ground: GroundMap
    paths: KnownPaths
    first_yaws: list[float]
    """Looks around that are left to do."""
    goal: np.ndarray | None = None
    """(5,) pose to which it is under way."""


class PlateauRule(Driver):
    """Drives rovers to poses on their plateau: a rule is a subclass with `pick`; see the top of the file."""

    most_blocked, repeats = 0, True
    edge: EdgeForm | None = None
    """How the edge of the plateau is taken; None = only columns that are known to carry the rover count."""
    interest_decay = 0.0
    """β of eq. 9; 0 = no interest is lost."""

    @abstractmethod
    def pick(self, view: RobotKnowledge, ground: GroundMap, reachable: np.ndarray) -> np.ndarray:
        """Return the pose (5,) to go to, map frame, in one of the (N,) reachable voxels."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission.

        Raises:
            SettingError: A robot of the team needs no ground, or looks level.
        """
        for kind in scenario.kinds:
            if scenario.ground_layer_of(kind.robot) is None or scenario.looks_level(kind.robot):
                allowed = "a team of rovers: Robot.above_ground_m and Robot.tilts are set, as in `cliff`"
                raise SettingError("Scenario.robot", kind.robot.motion, allowed)
        super().reset(scenario, rng)
        self._rovers: dict[int, Rover] = {}

    def ground_of(self, robot: int) -> GroundMap:
        """Return the ground as a rover knows it; available after its first choice."""
        return self._rovers[robot].ground

    def observe(self, view: RobotKnowledge) -> None:
        """Begin to keep what a rover knows at its first choice."""
        if view.robot not in self._rovers:
            turns = yaws_around(view.kind.sensor.field_of_view_rad[0])
            first_yaws = [view.pose[3] + turn for turn in turns]
            ground = GroundMap(view)
            # Paths need of a map where a body fits, and how to leave where it does not.
            cells = cast("VoxelFrontiers", ground)
            paths = KnownPaths(self._scenario, view.kind, cells, new_search(self._scenario.grid.voxels))
            self._rovers[view.robot] = Rover(ground, paths, first_yaws)

    def note_blocked(self, view: RobotKnowledge) -> None:
        """Choose anew."""
        self.forget_goal(view)

    def forget_goal(self, view: RobotKnowledge) -> None:
        """Choose anew at the next decision."""
        rover = self._rovers[view.robot]
        rover.goal = None
        rover.ground.expect_nothing()

    def give_way(self, view: RobotKnowledge, trail: Trail) -> None:
        """Choose anew."""
        self.forget_goal(view)

    def decide(self, view: RobotKnowledge) -> np.ndarray:
        """Return the viewpoint on the way to the rule's goal; see `Driver`."""
        rover = self._rovers[view.robot]
        if rover.first_yaws:
            return np.array([*view.pose[:3], rover.first_yaws.pop(), STEEP_RAD])
        ground, before = rover.ground, rover.ground.update(view, self.edge)
        if rover.goal is not None and self._arrived(view, rover.goal):
            ground.learn(before, self.interest_decay)
            rover.goal = None
        rover.paths.start(voxel_of(view, view.pose))
        reachable = reachable_voxels(ground.traversal_cost, rover.paths)
        if rover.goal is None or voxel_of(view, rover.goal) not in reachable:
            rover.goal = self.pick(view, ground, reachable)
        stop = rover.goal.copy()
        stop[:2] = path_points(view, rover.paths, rover.goal)[0, :2]
        return stop

    def _arrived(self, view: RobotKnowledge, goal: np.ndarray) -> bool:
        """Return whether a drive to a goal has ended there."""
        apart_m = float(np.linalg.norm(view.pose[:2] - goal[:2]))
        return not view.under_way and apart_m < _SAME_PLACE * self._scenario.grid.voxel_size_m
