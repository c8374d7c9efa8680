"""What robots get for a step: by the scenario's compiled reward, or by a function of one's own.

    def per_metre(figures):
        return figures.gained_bits - 50.0 * figures.distance_m

    env = parallel_env("room", reward_function=per_metre)

A function takes the figures of a step, of all missions at once, and returns their rewards. Missions, and
records of them, do not depend on it: it may be anything that Python can compute.
"""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.simulation import Missions

_RUNNING = MissionEnd.RUNNING.code


class StepFigures(NamedTuple):
    """What a step brought and cost, as arrays (E, A) for E missions of A robots.

    E is 1 except in vector environments.
    Of a mission that was over before the step, and only starts anew with it, all figures are 0.
    """

    gained_bits: np.ndarray
    """float64 bits taken from the robot's map by its own scans."""
    received_bits: np.ndarray
    """float64 bits taken from the robot's map by teammates' measurements."""
    elapsed_s: np.ndarray
    """float64 simulated seconds that the step took, the same for all robots of a mission."""
    distance_m: np.ndarray
    """float64 metres that the robot drove in the step."""
    bits_sent: np.ndarray
    """float64 bits that the robot sent over the channel."""
    ended: np.ndarray
    """bool, whether the mission ended with this step, the same for all robots of a mission."""


RewardFunction = Callable[[StepFigures], Any]
"""From the figures of a step to (E, A) finite numbers, the rewards."""


class _Counters(NamedTuple):
    """What is counted from a mission's start, before a step: (E, A), and (E,) for time and end."""

    distance_m: np.ndarray
    bits_sent: np.ndarray
    time_s: np.ndarray
    running: np.ndarray


class StepRewards:
    """The rewards of an adapter's steps."""

    def __init__(self, function: RewardFunction | None) -> None:
        """Reward by a function; None = by the scenario's reward.

        Raises:
            SettingError: It cannot be called.
        """
        if function is not None and not callable(function):
            raise SettingError("reward_function", function, "a function of StepFigures, or None")
        self.function = function

    @property
    def name(self) -> str:
        """Qualified name of the function; empty where there is none."""
        if self.function is None:
            return ""
        named = self.function if hasattr(self.function, "__qualname__") else type(self.function)
        return f"{named.__module__}.{named.__qualname__}"

    def before(self, missions: Missions) -> _Counters | None:
        """Return what `after` has to know of the moment before the step; None where there is no function."""
        if self.function is None:
            return None
        robots, clocks = missions.state.robots, missions.state.missions
        return _Counters(
            robots["distance_m"].copy(),
            robots["bits_sent"].astype(np.float64),
            clocks["time_s"].copy(),
            clocks["end"] == _RUNNING,
        )

    def after(self, missions: Missions, before: _Counters | None) -> np.ndarray:
        """Return the rewards of the step that was just taken, before any mission starts anew.

        Args:
            missions: After the step.
            before: What `before` gave.

        Returns:
            (E, A) float64, a new array; of missions that were over before the step they mean nothing.

        Raises:
            SettingError: The function returned something else than (E, A) finite numbers. The step has
                been taken all the same.
        """
        robots = missions.state.robots
        if before is None or self.function is None:
            return robots["reward"].copy()
        figures = _figures(missions, before)
        shape, given = robots.shape, self.function(figures)
        try:
            rewards = np.asarray(given)
        except (ValueError, TypeError, RuntimeError):  # lists of different lengths, tensors with gradients
            rewards = np.asarray(None)
        if rewards.shape != shape or rewards.dtype.kind not in "fiu" or not np.isfinite(rewards).all():
            allowed = f"finite numbers of shape {shape}: one for each mission and robot"
            raise SettingError(f"reward_function {self.name}(figures)", given, allowed)
        return rewards.astype(np.float64)

    def __deepcopy__(self, memo: dict[int, Any]) -> StepRewards:
        """Return a copy, also where the function could not be pickled."""
        return StepRewards(copy.deepcopy(self.function, memo))

    def __reduce__(self) -> tuple[type, tuple[RewardFunction | None]]:
        """Pickle the function by its name.

        Raises:
            SettingError: It cannot be pickled: it is a lambda, or was made inside another function.
        """
        try:
            pickle.dumps(self.function)
        except (pickle.PicklingError, AttributeError, TypeError):
            allowed = "a function from the top level of a module where an environment is pickled"
            raise SettingError("reward_function", self.function, allowed) from None
        return StepRewards, (self.function,)


def _figures(missions: Missions, before: _Counters) -> StepFigures:
    """Return the figures of the step since `before`."""
    robots, clocks = missions.state.robots, missions.state.missions
    team = np.ones(robots.shape)
    ran = before.running[:, None]
    return StepFigures(
        gained_bits=np.where(ran, robots["own_bits"], 0.0),
        received_bits=np.where(ran, robots["received_bits"], 0.0),
        elapsed_s=(clocks["time_s"] - before.time_s)[:, None] * team,
        distance_m=robots["distance_m"] - before.distance_m,
        bits_sent=robots["bits_sent"] - before.bits_sent,
        ended=(ran & (clocks["end"] != _RUNNING)[:, None]) & (team > 0.0),
    )
