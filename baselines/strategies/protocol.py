"""What a strategy is: it chooses viewpoints for robots from what each of them knows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from entropy_explore_env.frontiers.knowledge import random_viewpoint
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.scenario import Scenario

__all__ = ["Stopwatch", "Strategy", "random_viewpoint"]


class Strategy(Protocol):
    """Chooses viewpoints for a team, robot by robot.

    A strategy sees RobotViews and nothing else. What it returns goes through the environment's
    action space, like a learned policy's choice.
    """

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins.

        Args:
            scenario: The public settings.
            rng: The mission's stream for the strategy's own draws.
        """
        ...

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """Choose where robots go.

        Args:
            views: One of each robot that decides now, by number.

        Returns:
            For each view a viewpoint (5,): x, y, z, yaw, pitch; map frame, metres, radians.
        """
        ...


class Stopwatch:
    """A strategy whose decisions are timed, in milliseconds a robot."""

    def __init__(self, strategy: Strategy, clock: Callable[[], float]) -> None:
        """Nothing is measured yet; `clock` tells seconds."""
        self._strategy, self._clock = strategy, clock
        self.decisions_ms: list[float] = []

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._strategy.reset(scenario, rng)

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """What the strategy chooses; notes the time that it took for each view."""
        started = self._clock()
        chosen = self._strategy.choose(views)
        self.decisions_ms.append(1e3 * (self._clock() - started) / max(len(views), 1))
        return chosen
