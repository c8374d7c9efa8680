"""Named random streams: every kind of draw has a stream of its own, all spawned from one seed.

Python code draws from NumPy generators; compiled code from SplitMix64 (Steele, Lea & Flood 2014),
the state of which is one 64-bit number in an array.
"""

from __future__ import annotations

import enum
import math

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import is_whole

_SEEDS = 10**4000


class Stream(enum.IntEnum):
    """The purpose of a random draw; drawing from one stream does not change the others."""

    WORLD = 0
    STARTS = 1
    SENSOR = 2
    CHANNEL = 3
    STRATEGY = 4
    FAULTS = 5
    CANDIDATES = 6
    LOCALIZATION = 7
    FIDUCIALS = 8
    SIGHTINGS = 9


def seed_sequence(seed: int, episode: int, stream: Stream) -> np.random.SeedSequence:
    """Return the seed of one stream in episode number `episode` after a reset with `seed`."""
    return np.random.SeedSequence(entropy=seed, spawn_key=(episode, int(stream)))


def generator(seed: int, episode: int, stream: Stream) -> np.random.Generator:
    """Return a NumPy generator for one stream."""
    return np.random.default_rng(seed_sequence(seed, episode, stream))


def splitmix_states(seed: int, episode: int, stream: Stream, robots: int) -> np.ndarray:
    """Return (robots,) uint64 initial states for compiled draws, one for each robot."""
    return seed_sequence(seed, episode, stream).generate_state(robots, np.uint64)


def check_seed(seed: object) -> int:
    """Return the seed as an int; if it is None, a new one from the operating system.

    Raises:
        SettingError: It is neither None nor a whole number ≥ 0, or it has more than 4000 digits.
    """
    if seed is None:
        return int(np.random.SeedSequence().generate_state(1, np.uint64)[0])
    if not is_whole(seed, 0):
        raise SettingError("seed", seed, "a whole number ≥ 0, or None")
    if int(seed) >= _SEEDS:
        raise SettingError("seed", f"a number of {int(seed).bit_length()} bits", "at most 4000 digits")
    return int(seed)


@lean_kernel
def draw_uniform(state):
    """Return a uniform number in [0, 1) from SplitMix64; `state`, (1,) uint64, is advanced in place."""
    mixed = state[0] + np.uint64(0x9E3779B97F4A7C15)
    state[0] = mixed
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed = mixed ^ (mixed >> np.uint64(31))
    return np.float64(mixed >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@lean_kernel
def draw_gaussian(state):
    """Return a standard normal number (Box & Muller 1958); two uniform draws from `state`."""
    radius = math.sqrt(-2.0 * math.log(1.0 - draw_uniform(state)))
    return radius * math.cos(2.0 * math.pi * draw_uniform(state))
