"""Actions from outside, checked before anything changes, as the arrays that missions take."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from entropy_explore_env.errors import ActionError, SettingError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.settings.validation import is_whole

_ROUNDING = 1e-6


def masks_of(missions: Missions) -> np.ndarray:
    """Return (E, A, N) bool: which actions by number make sense by each robot's own belief.

    Raises:
        SettingError: Actions are no numbers.
    """
    action = missions.scenario.action
    if not action.by_number:
        raise SettingError("Action.kind", action.kind, "discrete or candidates: other actions have no masks")
    return missions.action_masks() == 1


class ActionChecker:
    """Checks actions against one robot's action space.

    Attributes:
        width: Numbers of a continuous action; 1 where actions are discrete.
    """

    def __init__(self, space: spaces.Box | spaces.Discrete) -> None:
        """Take the space's bounds."""
        self._discrete = isinstance(space, spaces.Discrete)
        self._count = int(space.n) if isinstance(space, spaces.Discrete) else 0
        self.width = 1 if isinstance(space, spaces.Discrete) else int(space.shape[0])

    def batch(self, actions: Sequence[tuple[str, Any]]) -> tuple[np.ndarray, np.ndarray]:
        """Return a team's actions as arrays.

        Args:
            actions: (agent, action) in the order of the robots.

        Returns:
            (A, N) float64 continuous actions and (A,) int64 discrete ones; one of them is zeros.

        Raises:
            ActionError: An action has the wrong shape or type, is not finite or outside its space.
        """
        continuous, discrete = np.zeros((len(actions), self.width)), np.zeros(len(actions), np.int64)
        for row, (agent, action) in enumerate(actions):
            if self._discrete:
                discrete[row] = self._checked_discrete(agent, action)
            else:
                continuous[row] = self._checked_continuous(agent, action)
        inside = np.abs(continuous) <= 1.0 + _ROUNDING
        if not inside.all():
            row = int(np.argmin(inside.all(axis=1)))
            allowed = "finite numbers from -1 to 1"
            raise ActionError(f"actions[{actions[row][0]}]", continuous[row].tolist(), allowed)
        return continuous, discrete

    def table(self, actions: object, missions: int, robots: int) -> tuple[np.ndarray, np.ndarray]:
        """Return actions of many missions as arrays.

        Args:
            actions: (E, A, N) numbers, or (E, A) whole numbers; without the axis A for one robot.
            missions: E.
            robots: A.

        Returns:
            (E, A, N) float64 and (E, A) int64.

        Raises:
            ActionError: As for `batch`.
        """
        given = as_array("actions", actions)
        leading = (missions,) if robots == 1 else (missions, robots)
        shape = leading if self._discrete else (*leading, self.width)
        wanted = "whole numbers" if self._discrete else "floating-point numbers"
        kind = np.integer if self._discrete else np.floating
        if given.shape != shape or not np.issubdtype(given.dtype, kind):
            raise ActionError("actions", f"{given.dtype} {given.shape}", f"{wanted} of shape {shape}")
        if self._discrete:
            outside = (given < 0) | (given >= self._count)
            if outside.any():
                raise ActionError("actions", given[outside][0], f"whole numbers from 0 to {self._count - 1}")
            return np.zeros((missions, robots, 1)), given.reshape(missions, robots).astype(np.int64)
        inside = np.abs(given) <= 1.0 + _ROUNDING
        if not inside.all():
            raise ActionError("actions", given[~inside][0], "finite numbers from -1 to 1")
        continuous = np.ascontiguousarray(given.reshape(missions, robots, self.width), np.float64)
        return continuous, np.zeros((missions, robots), np.int64)

    def _checked_discrete(self, agent: str, action: object) -> int:
        number: Any = action.item() if isinstance(action, np.ndarray) and action.shape == () else action
        if not is_whole(number, 0, self._count - 1):
            raise ActionError(f"actions[{agent}]", action, f"a whole number from 0 to {self._count - 1}")
        return int(number)

    def _checked_continuous(self, agent: str, action: object) -> np.ndarray:
        array = as_array(f"actions[{agent}]", action)
        if array.shape != (self.width,) or array.dtype.kind != "f":
            allowed = f"{self.width} floating-point numbers from -1 to 1"
            raise ActionError(f"actions[{agent}]", action, allowed)
        return array


def as_array(name: str, action: object) -> np.ndarray:
    """Return an array of whatever was given; what cannot be one is an ActionError."""
    try:
        return np.asarray(action)
    except Exception:  # lists of different lengths, or an __array__ of somebody else's
        raise ActionError(name, action, "numbers in the shape of the action space") from None
