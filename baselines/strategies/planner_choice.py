"""The strategy `planner-choice`: of the candidates that a policy chooses among, the planner's own choice.

Ours. It is `planned-rate` without the frontier cells by which that one explores some plans, and what a policy
that chooses among candidates begins as. It draws gazes at more far places, for a list of candidates, so that
its later draws differ from those of `planned-rate`, and single missions do.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.scenario import Scenario, with_settings


class PlannerChoice:
    """Chooses the first of the candidates."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._proposed = scenario.action.kind == "candidates"
        if not self._proposed:
            scenario = with_settings(scenario, {"action": {"kind": "candidates"}})
            self._proposer = ViewProposer(scenario, rng)

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoint (5,); where candidates are the actions, one of those that were proposed."""
        proposed = view.candidates if self._proposed else self._proposer.propose(view)
        return proposed[0].copy()
