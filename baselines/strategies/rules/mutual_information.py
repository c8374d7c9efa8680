"""The strategies `mutual-information` and `ground-gradient`: exploration coordinated or not (RochaMI).

A robot goes to the voxel l near it that maximises eq. 13 and looks along the entropy gradient there (eq. 11):

    ‖∇H(l)‖_N · λ(l) · ρ(x, l) · η(l) - κ · ϑ(x, l)

`ground-gradient` is the uncoordinated method: λ = η = 1, and ρ ignores teammates. What the paper leaves open
is the same in both:

- H is never negative (belief/visibility.py): gradients between voxels that count as known are 0.
- ‖·‖_N divides by the steepest gradient among the candidates; of equal voxels chance takes one.
- ρ is 1 - max μ over the voxels on the straight line but the last, and 0 where the body would touch
  something that is believed covered, or does not fit at its end.
- The robot wanders, to a random viewpoint within reach, where no candidate has a gain above 0, behind a
  teammate if robots do not wait there, and where it would choose the same viewpoint too often (a trap).
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from baselines.strategies.neighbourhood import Neighbourhood
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.knowledge import random_viewpoint
from entropy_explore_env.planner.driver import Driver, Trail
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.scenario import Scenario

_ALIKE_RAD = math.radians(15.0)
_MEMORY, _REPEATS = 8, 2
"""Latest choices of a robot, and how often a viewpoint is among them that is a trap."""


class MutualInformation(Driver):
    """Chooses viewpoints by eq. 13; coordinated or not."""

    rule = "mutual-information"
    most_blocked = 0
    repeats = True

    def __init__(self, coordinated: bool = True, distance_cost: float = 0.0) -> None:
        """Take the settings.

        Args:
            coordinated: Whether λ, η and ρ use what teammates announce.
            distance_cost: κ ≥ 0.

        Raises:
            SettingError: One of them is not allowed.
        """
        if not isinstance(coordinated, bool):
            raise SettingError("coordinated", coordinated, "True or False")
        if not 0.0 <= distance_cost < math.inf:
            raise SettingError("distance_cost", distance_cost, "a number ≥ 0")
        self._coordinated, self._distance_cost = coordinated, float(distance_cost)

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        self._chosen = [deque[np.ndarray](maxlen=_MEMORY) for _ in range(scenario.robots)]
        self._neighbourhood = Neighbourhood(self._coordinated, self._distance_cost, scenario, rng)

    def give_way(self, view: RobotKnowledge, trail: Trail) -> None:
        """Leave it to the rule: by RochaMI a robot wanders, or waits in place (`Robot.when_blocked`)."""

    def decide(self, view: RobotKnowledge) -> np.ndarray | None:
        """Return the viewpoint (5,) by the robot's belief and what it has heard; None = it wanders."""
        if view.move_end is MoveEnd.TEAMMATE and view.kind.robot.when_blocked == "wander":
            return None
        chosen, edge_m = self._chosen[view.robot], view.scenario.grid.voxel_size_m
        viewpoint = self._neighbourhood.best(view)
        if viewpoint is None:
            return None
        alike = sum(_alike(viewpoint, earlier, edge_m) for earlier in chosen)
        if alike >= _REPEATS:
            chosen.clear()
            return random_viewpoint(view, self._rng)
        chosen.append(viewpoint)
        return viewpoint


def _alike(one: np.ndarray, other: np.ndarray, voxel_size_m: float) -> bool:
    """Return whether two viewpoints are less than a voxel and 15° apart."""
    turn = abs((one[3] - other[3] + math.pi) % (2.0 * math.pi) - math.pi)
    near = float(np.abs(one[:3] - other[:3]).max()) < voxel_size_m
    return near and max(turn, abs(one[4] - other[4])) < _ALIKE_RAD
