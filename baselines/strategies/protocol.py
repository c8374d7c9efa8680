"""What a strategy is: it chooses a viewpoint for each robot from what that robot knows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from entropy_explore_env.errors import ActionError
from entropy_explore_env.frontiers.knowledge import random_viewpoint
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.settings.scenario import Scenario

if TYPE_CHECKING:
    from entropy_explore_env.envs.parallel_env import EntropyExploreEnv

__all__ = ["Bound", "Stopwatch", "Strategy", "choose_all", "random_viewpoint"]


class Strategy(Protocol):
    """Chooses viewpoints for the robots of a team, one by one.

    A strategy sees RobotViews and nothing else. What it returns goes through the environment's
    action space, like a learned policy's choice. A strategy that decides for several robots at once
    has a method `choose_all`, of the views of all robots that decide now, by number; it is called in
    place of `choose` and returns one viewpoint for each view.
    """

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission.

        Args:
            scenario: The public settings.
            rng: The mission's stream for the strategy's own draws.
        """
        ...

    def choose(self, view: RobotView) -> np.ndarray:
        """Choose where a robot goes.

        Args:
            view: What the robot knows; it decides now.

        Returns:
            (5,) viewpoint: x, y, z, yaw, pitch; map frame, metres, radians.
        """
        ...


@runtime_checkable
class Bound(Protocol):
    """A strategy that is told the truth. It shows what others could reach, and competes with none."""

    def tell_truth(self, env: EntropyExploreEnv) -> None:
        """Tell it of the environment in which it will act."""
        ...


def choose_all(strategy: Strategy, views: Sequence[RobotView]) -> list[np.ndarray]:
    """Return a viewpoint (5,) for each view, in their order.

    Raises:
        ActionError: The strategy's own `choose_all` returned another number of viewpoints.
    """
    together = getattr(strategy, "choose_all", None)
    if together is None:
        return [strategy.choose(view) for view in views]
    chosen = list(together(views))
    if len(chosen) != len(views):
        raise ActionError("viewpoints chosen", len(chosen), f"one for each of {len(views)} views")
    return chosen


class Stopwatch:
    """A strategy whose decisions are timed, in milliseconds for each robot."""

    def __init__(self, strategy: Strategy, clock: Callable[[], float]) -> None:
        """Measure nothing yet; `clock` returns seconds."""
        self._strategy, self._clock = strategy, clock
        self.decisions_ms: list[float] = []

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        self._strategy.reset(scenario, rng)

    def choose(self, view: RobotView) -> np.ndarray:
        """Return what the strategy chooses for one robot."""
        return self.choose_all([view])[0]

    def choose_all(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """Return what the strategy chooses, and note the time that it took for each view."""
        started = self._clock()
        chosen = choose_all(self._strategy, views)
        self.decisions_ms.append(1e3 * (self._clock() - started) / max(len(views), 1))
        return chosen
