"""The numbers of `candidate_features`, of candidates that were selected and of the robot's situation."""

from __future__ import annotations

import math
from typing import NamedTuple

from entropy_explore_env.belief.raycast import distance_between
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.candidate_features import COLUMNS, CONTEXT_COLUMNS, FEATURES
from entropy_explore_env.planner.far_places import bits_around
from entropy_explore_env.planner.nearby import cost_of
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.robots.motion import driving_time
from entropy_explore_env.viewpoints.evaluation import STRAIGHTENED

_SPOT, _FAR = int(Kind.SPOT), int(Kind.FAR)
_WIDTH = len(FEATURES)
_NEXT_BEST = 0.99
"""Score of what is worth as much as the planner's choice without being it."""
_HALF_SECONDS, _HALF_TIME_S, _HALF_MATES, _MOST_LOG_BITS = 10.0, 300.0, 2.0, 20.0
(
    _SCORE, _CHOSEN, _ON_SPOT, _IS_FAR, _KEPT, _BITS_LOG, _SECONDS, _SOONNESS, _AGAIN, _UNIQUE, _COMMON,
    _SLIVERS, _ELSEWHERE, _ADVANTAGE, _UNKNOWN, _DEPTH, _DIRECTNESS, _DISTANCE, _ANNOUNCED, _CONTEST, _TURN,
) = COLUMNS.values()  # fmt: skip
_ENTROPY, _REPORTED, _AROUND, _TIME, _MATES, _HEARD, _UNDER_WAY = CONTEXT_COLUMNS.values()


class Selection(NamedTuple):
    """The candidates that were selected, in numbers."""

    count: int  # Candidates
    kept: int  # Number in the pool of the one that the robot is on its way to; -1 = none
    remaining: float  # Bits left in the map; 0 where features are not wanted


@lean_kernel
def clip(value):
    """Return a share: within [0, 1], 0 for what is no number."""
    return min(max(value, 0.0), 1.0) if value == value else 0.0


@lean_kernel
def _path_length(proposer, situation, goal, kind):
    """Return the length of the path to a goal in voxel edges, straight where the robot drives so."""
    straight = distance_between(goal, situation.knowledge.pose)
    if straight > 1e-9 and (proposer.planned or kind == _FAR):
        cost = cost_of(proposer, situation, goal)
        if cost < math.inf:
            return max(straight, STRAIGHTENED * cost)
    return straight


@lean_kernel
def _distance_to_remaining(blocks, goal, remaining):
    """Return the mean straight distance of a place to the remaining bits, block by block."""
    if remaining <= 0.0:
        return 0.0
    total, edge, shape = 0.0, blocks.edge, blocks.bits.shape
    for i in range(shape[0]):
        x = (i + 0.5) * edge - goal[0]
        for j in range(shape[1]):
            y = (j + 0.5) * edge - goal[1]
            for k in range(shape[2]):
                if blocks.bits[i, j, k] > 0.0:
                    z = (k + 0.5) * edge - goal[2]
                    total += blocks.bits[i, j, k] * math.sqrt(x * x + y * y + z * z)
    return total / remaining


@lean_kernel
def _share_around(proposer, size, at, remaining):
    """Return the share of the remaining bits that is in the block of a place and those beside it."""
    blocks = proposer.blocks
    if remaining <= 0.0:
        return 0.0
    i = min(max(int(at[0]), 0), size[0] - 1) // blocks.edge
    j = min(max(int(at[1]), 0), size[1] - 1) // blocks.edge
    k = min(max(int(at[2]), 0), size[2] - 1) // blocks.edge
    return clip(bits_around(blocks.bits, i, j, k) / remaining)


@lean_kernel
def _contest(proposer, situation, goal, seconds):
    """Compare the seconds of the teammate that is at a goal soonest, driving straight, with the robot's."""
    soonest = math.inf
    for mate in situation.mates:
        if not mate.silent:
            length_m = distance_between(mate.place, goal) * proposer.refined.voxel_size_m
            there_s = driving_time(length_m, mate.max_speed_m_s, mate.acceleration_m_s2) + mate.scan_time_s
            soonest = min(soonest, there_s)
    if math.isinf(soonest):
        return 1.0
    return -1.0 if math.isinf(seconds) else (soonest - seconds) / (soonest + seconds)


@lean_kernel
def write_features(proposer, situation, selection, out):
    """Fill in (K·F,) float32, the features of the candidates of a Selection; zeros where there is none."""
    pool, taken = proposer.scratch.pool, proposer.scratch.taken
    for number in range(len(out)):
        out[number] = 0.0
    fewest_s, most = math.inf, pool[taken[0]].value
    for k in range(selection.count):
        fewest_s, most = min(fewest_s, pool[taken[k]].seconds), max(most, pool[taken[k]].value)
    for k in range(selection.count):
        row, number = out[k * _WIDTH : (k + 1) * _WIDTH], taken[k]
        bits, seconds, value = pool[number].bits, pool[number].seconds, pool[number].value
        row[_SCORE] = 1.0 if k == 0 else _NEXT_BEST * clip(value / most)
        row[_CHOSEN] = 1.0 if k == 0 else 0.0
        row[_KEPT] = 1.0 if number == selection.kept or _is_goal(situation, pool, number) else 0.0
        row[_BITS_LOG] = clip(math.log2(1.0 + bits) / _MOST_LOG_BITS)
        row[_SECONDS] = 1.0 if math.isinf(seconds) else seconds / (seconds + _HALF_SECONDS)
        row[_SOONNESS] = 0.0 if math.isinf(seconds) else clip(fewest_s / seconds)
        _write_view(proposer, k, row)
        _write_place(proposer, situation, number, selection, row)


@lean_kernel
def _is_goal(situation, pool, number):
    """Return whether a viewpoint of the pool leads to the far place to which the robot is on its way."""
    if not situation.experience.going or pool[number].kind != _FAR:
        return False
    return distance_between(pool[number].goal, situation.experience.goal) < 1e-6


@lean_kernel
def _diagonal(size):
    return math.sqrt(float(size[0] ** 2 + size[1] ** 2 + size[2] ** 2))


@lean_kernel
def _write_view(proposer, k, row):
    """Fill in the features of what candidate k should see."""
    scratch = proposer.scratch
    view, longest = scratch.views[k], proposer.refined.max_range_m / proposer.refined.voxel_size_m
    longest, seen = min(longest, _diagonal(proposer.lattice.grid)), max(view.seen, 1)
    row[_AGAIN] = clip(view.again_bits / view.bits)
    row[_UNIQUE] = clip(view.unique / seen)
    row[_COMMON] = clip(scratch.common[k, 0] / seen) if k > 0 else 1.0
    row[_SLIVERS] = clip(view.slivers / seen)
    row[_UNKNOWN] = clip(view.unknown / seen)
    row[_DEPTH] = clip(view.distance / seen / longest)
    row[_ANNOUNCED] = clip(view.announced_bits / view.all_bits)


@lean_kernel
def _write_place(proposer, situation, number, selection, row):
    """Fill in the features of where a viewpoint of the pool is, and of the way to it."""
    pool, here, size = proposer.scratch.pool, situation.knowledge.pose, situation.belief.size
    goal, kind, diagonal = pool[number].goal, pool[number].kind, _diagonal(size)
    row[_ON_SPOT] = 1.0 if kind == _SPOT else 0.0
    row[_IS_FAR] = 1.0 if kind == _FAR else 0.0
    straight, path = distance_between(goal, here), _path_length(proposer, situation, goal, kind)
    away = _distance_to_remaining(proposer.blocks, goal, selection.remaining)
    row[_ELSEWHERE] = 1.0 - _share_around(proposer, size, goal, selection.remaining)
    row[_ADVANTAGE] = min(max((away - path) / diagonal, -1.0), 1.0)
    row[_DIRECTNESS] = clip(straight / path) if path > 1e-9 else 1.0
    row[_DISTANCE] = clip(straight / diagonal)
    row[_CONTEST] = _contest(proposer, situation, goal, pool[number].seconds)
    row[_TURN] = math.cos(pool[number].viewpoint[3] - here[3])


@lean_kernel
def write_context(proposer, situation, remaining, out):
    """Fill in (C,) float32, the features of a robot's situation, with the bits that remain in its map."""
    known, heard = situation.knowledge, 0
    for mate in situation.mates:
        heard += int(not mate.silent)
    bits = known.gained_bits + known.heard_bits
    out[_ENTROPY] = clip(known.entropy_left)
    out[_REPORTED] = clip(known.heard_bits / bits if bits > 0.0 else 0.0)
    out[_AROUND] = _share_around(proposer, situation.belief.size, known.pose, remaining)
    out[_TIME] = known.time_s / (known.time_s + _HALF_TIME_S)
    out[_MATES] = known.teammates / (known.teammates + _HALF_MATES)
    out[_HEARD] = clip(heard / max(known.teammates, 1))
    out[_UNDER_WAY] = 1.0 if known.under_way else 0.0


@lean_kernel
def write_overlaps(proposer, count, out):
    """Fill in (K·K,) float32, what two of `count` candidates both see as a share of what the lesser one sees.

    It is 1 for a candidate with itself, and 0 where there is none.
    """
    scratch = proposer.scratch
    most = len(scratch.taken)
    for number in range(len(out)):
        out[number] = 0.0
    for k in range(count):
        out[k * most + k] = 1.0
        for other in range(k):
            fewer = max(min(scratch.views[k].seen, scratch.views[other].seen), 1)
            share = clip(scratch.common[k, other] / fewer)
            out[k * most + other] = out[other * most + k] = share
