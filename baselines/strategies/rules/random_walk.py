"""The strategy `random`: a viewpoint drawn uniformly within reach. It stands in every table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.scenario import Scenario


class RandomWalk:
    """Goes anywhere within reach and looks anywhere."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        del scenario
        self._rng = rng

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """A random viewpoint for each view."""
        return [random_viewpoint(view, self._rng) for view in views]
