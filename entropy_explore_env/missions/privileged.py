"""What only training may know: numbers for critics that join what all robots' maps hold.

This is the library's one interface for privileged training. Strategies and policies that act, and the
commands that test them, do not import it; a test sees to it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import kernel
from entropy_explore_env.missions.poses import pose_at
from entropy_explore_env.missions.simulation import Missions

_FOLD = 1e150
"""Ratios of voxels are multiplied up to this before their logarithm is taken."""
_SOON_S = 10.0
"""Seconds that become ½ as s / (s + 10)."""
_LEAST_LEFT = 1e-3
"""Share of the work left below which its logarithm does not go on."""


class Number(NamedTuple):
    """One of the numbers that critics may read."""

    name: str
    meaning: str


PRIVILEGED = (
    Number("own_left", "share of the bits that the mission asks for that the robot's own map still lacks"),
    Number("least_left", "the same of the team's best map, which ends most missions"),
    Number("most_left", "the same of the team's worst map"),
    Number("joint_left", "the same if every voxel were known as well as the robot does that knows it best"),
    Number("log_joint_left", "ln of that share, 0 at all and -1 at a thousandth or less"),
    Number(
        "nearest_mate", "distance of the nearest teammate as a share of the workspace's diagonal; 1 alone"
    ),
    Number("next_decision", "seconds until a teammate may decide next, as s / (s + 10); 1 alone"),
)
"""What `privileged_numbers` gives, in this order."""


def privileged_numbers(missions: Missions) -> np.ndarray:
    """Return what only training may know of each robot's situation.

    Args:
        missions: E missions of A robots.

    Returns:
        (E, A, P) float32, the numbers of PRIVILEGED.
    """
    state, robots = missions.state, missions.state.robots
    count, team = robots.shape
    start_bits = state.missions["entropy_start_bits"][:, None]
    asked_bits = start_bits - state.missions["entropy_end_bits"][:, None]
    joint_bits = np.empty(count)
    _joint_gain(state.precision, missions.rules.params["prior_precision"][0], joint_bits)
    own_left = 1.0 - (start_bits - robots["entropy_bits"]) / asked_bits
    joint_left = 1.0 - joint_bits[:, None] / asked_bits
    log_left = np.log(np.clip(joint_left, _LEAST_LEFT, 1.0)) / -np.log(_LEAST_LEFT)
    numbers = np.empty((count, team, len(PRIVILEGED)), np.float32)
    numbers[:, :, 0] = own_left
    numbers[:, :, 1], numbers[:, :, 2] = own_left.min(axis=1)[:, None], own_left.max(axis=1)[:, None]
    numbers[:, :, 3], numbers[:, :, 4] = joint_left, log_left
    diagonal = float(np.linalg.norm(missions.grid.size_m))
    nearest, soonest = np.empty((2, count, team), np.float32)
    _fill_mates(missions.rules.params, state.missions, robots, diagonal, nearest, soonest)
    numbers[:, :, 5], numbers[:, :, 6] = nearest, soonest
    return numbers


@kernel
def _fill_mates(params, missions, robots, diagonal, nearest, soonest):
    """Fill (E, A) with the nearest teammate's distance and the soonest decision of one, scaled.

    Args:
        diagonal: Of the workspace, metres.
        nearest: (E, A) float32, filled in.
        soonest: (E, A) float32, filled in.
    """
    count, team = robots.shape
    for mission in range(count):
        time_s = missions[mission].time_s
        for robot in range(team):
            here = pose_at(params[robot], robots[mission, robot], time_s)
            least, soon_s = np.inf, np.inf
            for mate in range(team):
                if mate == robot:
                    continue
                other = robots[mission, mate]
                there = pose_at(params[mate], other, time_s)
                apart = 0.0
                for axis in range(3):
                    apart += (there[axis] - here[axis]) ** 2
                least = min(least, math.sqrt(apart))
                wait_s = 0.0 if other.deciding else min(other.ready_s, other.redecide_s) - time_s
                soon_s = min(soon_s, max(wait_s, 0.0))
            nearest[mission, robot] = min(least / diagonal, 1.0)
            soonest[mission, robot] = soon_s / (soon_s + _SOON_S) if soon_s < np.inf else 1.0


@kernel
def _joint_gain(precision, prior, bits):
    """Fill (E,) with Σ ½ log2(max p / p0), the bits of maps that know each voxel as well as anybody does.

    Args:
        precision: (E, A, V) float32, 1/σ².
        prior: p0.
        bits: (E,) float64, filled in.
    """
    missions, team, voxels = precision.shape
    for mission in range(missions):
        logs, product = 0.0, 1.0
        for voxel in range(voxels):
            most = precision[mission, 0, voxel]
            for robot in range(1, team):
                most = max(most, precision[mission, robot, voxel])
            product *= most / prior
            if product > _FOLD:
                logs += math.log2(product)
                product = 1.0
        bits[mission] = 0.5 * (logs + math.log2(product))
