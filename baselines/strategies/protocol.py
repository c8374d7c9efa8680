"""What a strategy is: it chooses viewpoints for robots from what each of them knows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.scenario import Scenario

_DRAWS = 64


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
    """A strategy, and how long its decisions take, in milliseconds a robot."""

    def __init__(self, strategy: Strategy, clock: Callable[[], float]) -> None:
        """Nothing is measured yet; `clock` tells seconds."""
        self._strategy, self._clock = strategy, clock
        self.decisions_ms: list[float] = []

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._strategy.reset(scenario, rng)

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """What the strategy chooses; how long a view took it is noted."""
        started = self._clock()
        chosen = self._strategy.choose(views)
        self.decisions_ms.append(1e3 * (self._clock() - started) / max(len(views), 1))
        return chosen


def random_viewpoint(view: RobotView, rng: np.random.Generator) -> np.ndarray:
    """A viewpoint drawn uniformly within reach, inside the workspace; the gaze in any direction.

    Args:
        view: Of the robot; planar robots stay in their plane and look level.
        rng: To draw from.

    Returns:
        (5,) viewpoint.
    """
    grid, reach_m = view.scenario.grid, view.kind.robot.reach_m
    low = np.asarray(grid.origin_m)
    high = low + grid.size_m
    axes = 2 if view.planar else 3
    viewpoint = view.pose.copy()
    here = view.pose[:axes]
    if math.isinf(reach_m):  # actions reach from the centre of the first voxel to that of the last
        low, high = low + 0.5 * grid.voxel_size_m, high - 0.5 * grid.voxel_size_m
    lowest, highest = np.maximum(low[:axes], here - reach_m), np.minimum(high[:axes], here + reach_m)
    for _ in range(_DRAWS):
        place = rng.uniform(lowest, highest)
        if ((place - here) ** 2).sum() <= reach_m**2:
            viewpoint[:axes] = place
            break
    viewpoint[3] = rng.uniform(-math.pi, math.pi)
    viewpoint[4] = 0.0 if view.planar else math.asin(rng.uniform(-1.0, 1.0))
    return viewpoint
