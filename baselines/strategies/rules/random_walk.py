"""The strategy `random`: a viewpoint drawn uniformly within reach. It stands in every table."""

from __future__ import annotations

import numpy as np

from entropy_explore_env.frontiers.knowledge import random_viewpoint
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.settings.scenario import Scenario


class RandomWalk:
    """Goes anywhere within reach and looks anywhere."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        del scenario
        self._rng = rng

    def choose(self, view: RobotView) -> np.ndarray:
        """Return a random viewpoint (5,)."""
        return random_viewpoint(view, self._rng)
