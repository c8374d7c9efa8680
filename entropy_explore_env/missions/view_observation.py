"""What a policy observes and does, from what one robot knows: learned policies see what strategies see.

Observations are those that the environment gives to a policy, written by the same compiled code.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.belief.pooling import Pool, pool_belief
from entropy_explore_env.belief.raycast import Crossing
from entropy_explore_env.missions.action import decode_action
from entropy_explore_env.missions.observation.layout import ObservationLayout, part_offsets
from entropy_explore_env.missions.observation.observe import Known, observe_robot
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_candidates import ViewProposer, writable
from entropy_explore_env.prediction.predictor import predicting_of
from entropy_explore_env.robots.range_sensor import new_scan
from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.scenario import Scenario


class ViewObserver:
    """Observations and actions of one form, whatever form the environment itself has.

    Attributes:
        scenario: The environment's scenario with the policy's observation and action.
        layout: What an observation is made of.
    """

    def __init__(
        self,
        scenario: Scenario,
        observation: Observation,
        action: Action,
        rng: np.random.Generator | None = None,
    ) -> None:
        """Make room for one observation; where actions are candidates, begin a mission.

        Args:
            scenario: What views are of.
            observation: What the policy observes.
            action: How it writes viewpoints.
            rng: What candidates are drawn from, where actions are candidates; None = always the same draws.
        """
        self.scenario = with_settings(scenario, {"observation": observation, "action": action})
        self.layout = ObservationLayout(self.scenario)
        self._rules = rules_of(self.scenario)
        self._offsets = part_offsets(self.scenario, self.layout)
        sensors = [kind.sensor for kind in scenario.kinds]
        scan = new_scan(scenario.grid, sensors, 1)
        self._crossing = Crossing(scan.crossed[0], scan.entered)
        self._predicting = predicting_of(observation)
        self._pooled = np.zeros((2, len(self._rules.cells.voxels)))
        self._proposer: ViewProposer | None = None
        if action.kind == "candidates":
            drawn_from = np.random.default_rng(0) if rng is None else rng
            self._proposer = ViewProposer(self.scenario, drawn_from, observation.overlaps)

    def observe(self, view: RobotView) -> np.ndarray:
        """Return the flat observation of a robot.

        Returns:
            (F,) float32.
        """
        mean, precision = writable(view.mean), writable(view.precision)
        out = np.zeros(self.layout.size, np.float32)
        params = self._rules.params[view.robot]
        if len(self._rules.cells.voxels):
            ends = (float(params["prior_precision"]), float(params["end_precision"]))
            pool_belief(Pool(self._rules.cells, self._pooled, *ends), mean, precision)
        x, y, z, yaw, pitch = view.pose.tolist()
        known = Known(
            (x, y, z, yaw, pitch),
            view.time_s,
            view.entropy_bits,
            view.deciding,
            view.speed_m_s,
            view.target.copy(),
            view.heard.copy(),
            mean,
            precision,
            self._pooled,
        )
        scratch = (self._crossing, self._predicting)
        observe_robot(self._rules, self._offsets, view.robot, known, *scratch, out)
        if self._proposer is not None:
            self._describe_candidates(self._proposer, view, out)
        return out

    def _describe_candidates(self, proposer: ViewProposer, view: RobotView, out: np.ndarray) -> None:
        """Fill in the parts of a flat observation about candidates; zeros while the robot is busy."""
        mask = np.zeros(self.scenario.action.candidates)
        mask[0] = 1.0
        parts: dict[str, np.ndarray] = {}
        if view.deciding:
            mask[: len(proposer.propose(view))] = 1.0
            parts["candidates"] = proposer.features(view.robot)
            parts["context"] = proposer.context(view.robot)
            parts["overlaps"] = proposer.overlaps(view.robot)
        parts["action_mask"] = mask
        for name, values in parts.items():
            if name in self.layout.parts:
                part = self.layout.parts[name]
                out[part.start : part.stop] = values.reshape(-1)

    def viewpoint(self, view: RobotView, action: np.ndarray | int) -> np.ndarray:
        """Return where an action of the policy sends a robot.

        Args:
            action: A number, or (N,), as the policy's action says.

        Returns:
            (5,) viewpoint: x, y, z, yaw, pitch; map frame, metres, radians.
        """
        if self._proposer is not None:
            return self._proposer.viewpoint(view.robot, int(action))
        discrete = self.scenario.action.kind == "discrete"
        continuous = np.zeros(5) if discrete else np.asarray(action, np.float64)
        viewpoint, params, number = (
            np.zeros(5),
            self._rules.params[view.robot],
            int(action) if discrete else 0,
        )
        decode_action(params, self._rules.actions, view.pose.copy(), continuous, number, viewpoint)
        return viewpoint
