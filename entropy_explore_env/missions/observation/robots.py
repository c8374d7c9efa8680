"""The parts of an observation that tell of robots.

`self`: pose, time, entropy and kind; `drive`: speed and chosen viewpoint; `team`: what teammates announced.
"""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import lean_kernel

SELF_VALUES = 10
"""Without the kinds of a mixed team."""
DRIVE_VALUES = 8
TEAMMATE_VALUES = 19
_HALF_LIFE_S = 60.0
"""Age of news that counts as ½."""


@lean_kernel
def observe_self(begin, params, kinds, known, row):
    """Fill (10 + K,): the robot's pose, the time, the entropy left, whether it decides, and its kind.

    Args:
        kinds: K; 0 if all robots are alike.
    """
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out = row[begin:]
    for axis in range(3):
        extent = params.size[axis] * params.voxel_size_m
        out[axis] = min(max(2.0 * (known.pose[axis] - params.origin_m[axis]) / extent - 1.0, -1.0), 1.0)
    out[3], out[4] = math.cos(known.pose[3]), math.sin(known.pose[3])
    out[5], out[6] = math.cos(known.pose[4]), math.sin(known.pose[4])
    out[7] = min(known.time_s / params.time_limit_s, 1.0)
    out[8] = entropy_left(params, known.entropy_bits)
    out[9] = 1.0 if known.deciding else 0.0
    for kind in range(kinds):
        out[SELF_VALUES + kind] = 1.0 if kind == params.kind else 0.0


@lean_kernel
def entropy_left(params, entropy_bits):
    """Share of a map's entropy that is left: 1 at the start, 0 with all voxels known."""
    voxels = params.size[0] * params.size[1] * params.size[2]
    least = 0.5 * voxels * math.log2(2.0 * math.pi * math.e / params.end_precision)
    span = 0.5 * voxels * math.log2(params.end_precision / params.prior_precision)
    return min(max((entropy_bits - least) / span, 0.0), 1.0)


@lean_kernel
def observe_drive(begin, params, known, row):
    """Fill (8,): speed as a share of the top speed, and the viewpoint that the robot chose last."""
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out = row[begin:]
    out[0] = min(known.speed_m_s / params.max_speed_m_s, 1.0)
    write_relative(params, known.pose, known.target, out[1:])


@lean_kernel
def observe_team(begin, params, robot, known, row):
    """Fill ((A-1)·19,): where teammates were last heard, and what they announced."""
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out = row[begin:]
    for number in range((len(known.heard) - 1) * TEAMMATE_VALUES):
        out[number] = 0.0
    diagonal = 0.0
    for axis in range(3):
        diagonal += (params.size[axis] * params.voxel_size_m) ** 2
    diagonal = math.sqrt(diagonal)
    place = 0
    for mate in range(len(known.heard)):
        if mate == robot:
            continue
        news = known.heard[mate]
        row = out[place : place + TEAMMATE_VALUES]
        place += TEAMMATE_VALUES
        if news.heard_s >= 0.0:
            age = known.time_s - news.heard_s
            row[0], row[8] = 1.0, age / (age + _HALF_LIFE_S)
            write_relative(params, known.pose, news.pose, row[1:])
        if news.announced_s >= 0.0:
            row[9] = 1.0
            write_relative(params, known.pose, news.announced, row[10:])
            row[17], row[18] = min(news.announced[5] / diagonal, 1.0), news.announced[6] / math.pi


@lean_kernel
def write_relative(params, pose, other, out):
    """Fill (7,): another pose's place, relative, in workspace sizes; cos and sin of its yaw and pitch."""
    for axis in range(3):
        extent = params.size[axis] * params.voxel_size_m
        out[axis] = min(max((other[axis] - pose[axis]) / extent, -1.0), 1.0)
    out[3], out[4] = math.cos(other[3]), math.sin(other[3])
    out[5], out[6] = math.cos(other[4]), math.sin(other[4])
