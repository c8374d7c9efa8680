"""The part `team`: where teammates were last heard, and what they announced."""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import lean_kernel

TEAMMATE_VALUES = 19
_HALF_LIFE_S = 60.0
"""Age of news that counts as ½."""


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
