"""What must hold at each step of a vector environment: steps are kept, and checked many at once.

A look at every number of a small batch's state costs more than its step, most of it for calls of NumPy. So
the state that is small, all but voxels and rays, is copied after each step, and some hundred steps are
checked in one pass, as if they were so many more missions. Observations, and the rays of messages that are on
their way, are looked at in place, by compiled kernels.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from benchmarks.reliability.settings_fuzz import BrokenPromiseError
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.missions.state_ranges import (
    FROM_WORLD,
    check_ranges,
    longest_ray,
    rays_of_messages,
)
from entropy_explore_env.robots.range_sensor import Return

_LARGE = (
    *FROM_WORLD,
    "mean",
    "precision",
    "pooled",
    "joint_mean",
    "joint_precision",
    "scan_range_m",
    "scan_returned",
    "scan_utility_bits",
    "own_mean",
    "own_precision",
    "in_flight_rays",
    "phase_rays",
    "in_flight_summaries",
)
"""Arrays of voxels and rays, and summaries of maps, which are not copied."""
_MOST_BYTES, _MOST_STEPS = 16 << 20, 200
_BITS = 1e-6
"""Rounding of sums of bits, as a share of a map's."""
_LEAST_RETURN, _MOST_RETURN = float(min(Return)), float(max(Return))


class CheckedSteps:
    """The steps since they were checked last, and the moment before them."""

    def __init__(self, env: EntropyExploreVectorEnv) -> None:
        """Begin with this moment.

        Args:
            env: After a reset or a step.
        """
        self._env = env
        arrays = env.missions.state._asdict()
        small = {name: array for name, array in arrays.items() if name not in _LARGE}
        step_bytes = sum(array.nbytes for array in small.values())
        self._most = min(max(_MOST_BYTES // step_bytes, 1), _MOST_STEPS)
        shape = (self._most + 1,)
        self._kept: dict[str, Any] = {
            name: np.zeros(shape + array.shape, array.dtype) for name, array in small.items()
        }
        self._bytes = {
            name: kept.reshape(len(kept), -1).view(np.uint8) for name, kept in self._kept.items() if kept.size
        }
        missions = (*shape, env.num_envs)
        self._longest = longest_ray(env.scenario)
        self._outside = np.zeros(shape, np.int64)
        self._wrong_rays = np.zeros(shape, np.int64)
        self._rewards = np.zeros(missions)
        self._robot_rewards = np.zeros((*missions, env.scenario.robots))
        self._ends = np.zeros((*missions, 2), bool)
        self._count = 0
        self._copy(0)

    def note(self, stepped: tuple[Any, ...]) -> None:
        """Keep what a step gave; when enough steps are kept, all of them are checked.

        Args:
            stepped: What `step` returned.

        Raises:
            BrokenPromiseError: As of `check`.
            RecordError: Likewise.
        """
        self._count += 1
        missions, place = self._env.missions, self._count
        self._copy(place)
        low, high = missions.layout.low, missions.layout.high
        self._outside[place] = numbers_outside(missions.observations, low, high)
        messages = rays_of_messages(missions.state._asdict()).values()
        self._wrong_rays[place] = sum(
            wrong_rays(rays.reshape(-1, *rays.shape[-2:]), counts.reshape(-1), self._longest)
            for rays, counts in messages
            if rays.size
        )
        self._rewards[place] = stepped[1]
        self._robot_rewards[place] = stepped[4]["reward_robots"].reshape(self._robot_rewards.shape[1:])
        self._ends[place, :, 0], self._ends[place, :, 1] = stepped[2], stepped[3]
        if place == self._most:
            self.check()

    def _copy(self, place: int) -> None:
        """Copy the small state; bytes, because fields of structures would be copied one by one."""
        state = self._env.missions.state
        for name, kept in self._bytes.items():
            kept[place] = getattr(state, name).reshape(-1).view(np.uint8)

    def check(self, maps: bool = False) -> None:
        """Check the steps that are kept; those that come are compared with the last of them.

        Args:
            maps: Whether to look at every voxel of this moment, too, and at the rays of scans and of
                messages that came to their end.

        Raises:
            BrokenPromiseError: Observations are outside their space, rewards not finite, ends not said, time
                ran backwards, or the bits gained are not those by which entropy fell.
            RecordError: A number of the state is in no mission of the scenario.
        """
        if self._count:
            self._check_promises()
            state, many = self._env.missions.state, self._count * self._env.num_envs
            steps = {name: self._flat(kept) for name, kept in self._kept.items()}
            for name in ("in_flight_rays", "phase_rays", "in_flight_summaries"):  # for their shapes alone
                steps[name] = np.broadcast_to(0.0, (many, *getattr(state, name).shape[1:]))
            check_ranges(self._env.scenario, steps, voxels_and_rays=False)
        if maps:
            check_ranges(self._env.scenario, self._env.missions.state._asdict())
        self._count = 0
        self._copy(0)

    def _flat(self, kept: np.ndarray) -> np.ndarray:
        """(N·E, ...): the missions of N steps, as if they were so many missions."""
        return kept[1 : self._count + 1].reshape(self._count * kept.shape[1], *kept.shape[2:])

    def _check_promises(self) -> None:
        """Compare each step with the one before."""
        name, now = self._env.scenario.name, slice(1, self._count + 1)
        missions, robots = (self._kept[part][: self._count + 1] for part in ("missions", "robots"))
        outside = int(self._outside[now].sum())
        if outside:
            raise BrokenPromiseError(f"{name}: {outside} numbers of observations are outside their space")
        if self._wrong_rays[now].any():
            raise BrokenPromiseError(f"{name}: {self._wrong_rays[now].sum()} rays of messages are none")
        for rewards in (self._rewards[now], self._robot_rewards[now]):
            if not np.isfinite(rewards).all():
                raise BrokenPromiseError(f"{name}: rewards are {rewards[~np.isfinite(rewards)][:9]}")
        over, ends = missions["end"] != 0, self._ends[now]
        if not np.array_equal(ends.any(axis=-1), over[1:]) or ends.all(axis=-1).any():
            raise BrokenPromiseError(f"{name}: missions end, and the step does not say so")
        begun, time_s = over[:-1], missions["time_s"]
        if (time_s[1:] < time_s[:-1])[~begun].any() or time_s[1:][begun].any():
            raise BrokenPromiseError(f"{name}: time ran backwards, or a mission did not begin at 0 s")
        entropy_bits = robots["entropy_bits"]
        told = (robots["own_bits"] + robots["received_bits"])[1:]
        scale = _BITS * np.maximum(np.abs(entropy_bits[:-1]), 1.0)
        if (np.abs(entropy_bits[:-1] - entropy_bits[1:] - told) > scale)[~begun].any():
            raise BrokenPromiseError(f"{name}: bits gained are not those by which entropy fell")


@lean_kernel
def numbers_outside(observations, low, high):
    """How many numbers of observations are outside their space, NaN among them.

    Args:
        observations: (E, A, F) float32.
        low: (F,) float64, the least.
        high: (F,) float64, the largest.
    """
    outside = 0
    for mission in range(observations.shape[0]):
        for robot in range(observations.shape[1]):
            for place in range(observations.shape[2]):
                seen = observations[mission, robot, place]
                within = np.float32(low[place]) <= seen <= np.float32(high[place])
                outside += int(not within)
    return outside


@lean_kernel
def wrong_rays(rays, counts, longest):
    """How many rays of messages on their way are no measurements; see `state_ranges`.

    Args:
        rays: (M, B, 5) float64 unit vectors, distances in grid units, a Return each.
        counts: (M,) int64, how many rays of a message are in use; -1 and 0 = none.
        longest: Grid units that no distance is beyond.
    """
    wrong = 0
    for message in range(rays.shape[0]):
        for number in range(counts[message]):
            ray = rays[message, number]
            square = ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]
            measured = 0.0 <= ray[3] <= longest and _LEAST_RETURN <= ray[4] <= _MOST_RETURN
            wrong += int(not (abs(square - 1.0) <= _BITS and measured and ray[4] == math.floor(ray[4])))
    return wrong
