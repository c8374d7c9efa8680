"""What a policy observes and does, from what one robot knows: learned policies see what strategies see.

Observations are those that the environment gives to a policy, written by the same compiled code.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.belief.pooling import pool_belief
from entropy_explore_env.missions.action import decode_action
from entropy_explore_env.missions.observation import ObservationLayout, observation_rules, observe_robot
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.missions.state import HEARD
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.range_sensor import new_scan
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.settings import Action, Observation


class ViewObserver:
    """Observations and actions of one form, whatever form the environment itself has.

    Attributes:
        scenario: The environment's scenario with the policy's observation and action.
        layout: What an observation is made of.
    """

    def __init__(self, scenario: Scenario, observation: Observation, action: Action) -> None:
        """Make room for one observation.

        Args:
            scenario: What views are of.
            observation: What the policy observes.
            action: How it writes viewpoints.
        """
        self.scenario = with_settings(scenario, {"observation": observation, "action": action})
        self.layout = ObservationLayout(self.scenario)
        self._rules = rules_of(self.scenario)
        self._parts = observation_rules(self.scenario, self.layout)
        sensors = [kind.sensor for kind in scenario.kinds]
        self._scan = new_scan(scenario.grid, sensors, 1, scenario.robots)
        cells = self._rules.cells
        self._pooled = np.zeros((2, 0 if cells is None else len(cells.voxels)))

    def observe(self, view: RobotView) -> np.ndarray:
        """The flat observation of a robot.

        Args:
            view: Of the robot.

        Returns:
            (F,) float32.
        """
        mean, precision, out = (
            view.mean.ravel(),
            view.precision.ravel(),
            np.zeros(self.layout.size, np.float32),
        )
        numbers = self._rules.numbers[view.robot]
        if self._rules.cells is not None:
            ends = (float(numbers["prior_precision"]), float(numbers["end_precision"]))
            pool_belief(self._rules.cells, self._pooled, ends, mean, precision)
        observe_robot(
            self._rules,
            self._parts,
            view.robot,
            tuple(view.pose.tolist()),
            view.time_s,
            view.entropy_bits,
            view.deciding,
            _heard(view, self.scenario.robots),
            mean,
            precision,
            self._pooled,
            self._scan,
            out,
        )
        return out

    def viewpoint(self, view: RobotView, action: np.ndarray | int) -> np.ndarray:
        """Where an action of the policy sends a robot.

        Args:
            view: Of the robot.
            action: A number, or (N,), as the policy's action says.

        Returns:
            (5,) viewpoint: x, y, z, yaw, pitch; map frame, metres, radians.
        """
        discrete = self.scenario.action.kind == "discrete"
        box = np.zeros(5) if discrete else np.asarray(action, np.float64)
        viewpoint = np.zeros(5)
        decode_action(self._rules, view.robot, view.pose, box, int(action) if discrete else 0, viewpoint)
        return viewpoint


def _heard(view: RobotView, robots: int) -> np.ndarray:
    """(A,) HEARD as the environment holds it."""
    heard = np.zeros(robots, HEARD)
    heard["heard_s"] = heard["announced_s"] = -1.0
    for number, mate in view.teammates.items():
        heard[number] = (
            mate.heard_s,
            mate.pose,
            mate.announced_s,
            (*mate.viewpoint, mate.depth_m, mate.half_angle_rad),
        )
    return heard
