"""Rows for training whose observations end with numbers that no robot may know: for critics.

A policy that is trained on them must not act on the last P numbers; `training.candidate_network` reads them
in its critic alone. Policies that act or are evaluated have RobotView and the other adapters, without them.
"""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.observation.layout import short_repr
from entropy_explore_env.missions.privileged import PRIVILEGED, privileged_numbers


class _PrivilegedVectorEnv(EntropyExploreVectorEnv):
    """Missions whose flat observations are followed by the numbers of PRIVILEGED."""

    def robot_space(self) -> spaces.Space:
        """Return a Box of flat observations and P further numbers.

        Raises:
            SettingError: Observations are not flat.
        """
        if not self.missions.layout.flat:
            raise SettingError("observation.flat", False, "True, for observations with privileged numbers")
        flat = self.missions.layout.flat_space()
        unbounded = np.full(len(PRIVILEGED), np.inf, np.float32)
        low, high = np.concatenate([flat.low, -unbounded]), np.concatenate([flat.high, unbounded])
        return short_repr(spaces.Box(low, high, dtype=np.float32))

    def _vectors(self) -> np.ndarray:
        """Return (E, A, F + P) float32."""
        return np.concatenate([self.missions.observations, privileged_numbers(self.missions)], axis=2)


class PrivilegedVecEnv(RobotVecEnv):
    """A RobotVecEnv whose observations end with the P numbers of `missions.privileged.PRIVILEGED`."""

    _missions_of = _PrivilegedVectorEnv
