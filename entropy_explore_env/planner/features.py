"""The numbers of `candidate_features`, of candidates that were selected and of the robot's situation."""

from __future__ import annotations

import math
from typing import NamedTuple

from entropy_explore_env.belief.paths.search import cost_to
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.candidate_features import COLUMNS, CONTEXT_COLUMNS, FEATURES
from entropy_explore_env.planner.far_places import bits_around
from entropy_explore_env.planner.memory import distance_apart, trust_in
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.thresholds import REMEMBERED
from entropy_explore_env.robots.motion import driving_time
from entropy_explore_env.viewpoints.evaluation import STRAIGHTENED, voxel_at

_SPOT, _NEAR, _FAR = int(Kind.SPOT), int(Kind.NEAR), int(Kind.FAR)
_WIDTH = len(FEATURES)
_NEXT_BEST = 0.99
"""Score of what is worth as much as the planner's choice without being it."""
_HALF_SECONDS, _HALF_TIME_S, _HALF_MATES, _MOST_LOG_BITS = 10.0, 300.0, 2.0, 20.0
(
    _SCORE, _CHOSEN, _ON_SPOT, _IS_NEAR, _IS_FAR, _KEPT, _BITS, _BITS_LOG, _SECONDS, _SOONNESS, _RATE,
    _RATE_EVER, _RANK, _AGAIN, _UNIQUE, _COMMON, _SLIVERS, _ELSEWHERE, _ADVANTAGE, _UNKNOWN, _DEPTH,
    _DIRECTNESS, _DISTANCE, _ANNOUNCED, _SECOND, _THIRD, _CONTEST, _TRUST, _AHEAD, _LEFT, _UP, _TURN_COS,
    _TURN_SIN, _PITCH,
) = COLUMNS.values()  # fmt: skip
(
    _C_ENTROPY, _C_REPORTED, _C_BITS, _C_RATE, _C_FAR, _C_AROUND, _C_TIME, _C_CANDIDATES, _C_MATES, _C_HEARD,
    _C_NEAREST, _C_BLOCKED, _C_FAILURES, _C_UNDER_WAY, _C_PLANAR, _C_ALL_AROUND, _C_SCAN_TIME,
) = CONTEXT_COLUMNS.values()  # fmt: skip


class Selection(NamedTuple):
    """The candidates that were selected, in numbers."""

    count: int
    """Candidates."""
    kept: int
    """Number in the pool of the one that the robot is on its way to; -1 = none."""
    near_value: float
    """Of the best viewpoint nearby."""
    far_value: float
    """Of the best far place; 0 = none was found or looked for."""
    remaining: float
    """Bits left in the map."""


@lean_kernel
def clip(value):
    """Return a share: within [0, 1], 0 for what is no number."""
    return min(max(value, 0.0), 1.0) if value == value else 0.0


@lean_kernel
def _diagonal(size):
    return math.sqrt(float(size[0] ** 2 + size[1] ** 2 + size[2] ** 2))


@lean_kernel
def _rate(bits, seconds):
    return bits / seconds if seconds < math.inf else 0.0


@lean_kernel
def _path_length(proposer, situation, goal, kind):
    """Return the length of the path to a goal in voxel edges, straight where the robot drives so."""
    straight = distance_apart(goal, situation.knowledge.pose)
    if straight > 1e-9 and (proposer.planned or kind == _FAR):
        cost = cost_to(proposer.scratch.search, voxel_at(situation.belief.size, goal))
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
            length_m = distance_apart(mate.place, goal) * proposer.exact.voxel_size_m
            there_s = driving_time(length_m, mate.max_speed_m_s, mate.acceleration_m_s2) + mate.scan_time_s
            soonest = min(soonest, there_s)
    if math.isinf(soonest):
        return 1.0
    return -1.0 if math.isinf(seconds) else (soonest - seconds) / (soonest + seconds)


@lean_kernel
def write_features(proposer, situation, selection, out):
    """Fill in the features of all candidates; zeros where there is no candidate.

    Args:
        proposer: See `nearby`, with what was selected; its blocks hold the map's remaining bits.
        situation: See `nearby`.
        selection: Selection.
        out: (K·F,) float32, filled in.
    """
    scratch, experience = proposer.scratch, situation.experience
    pool, taken = scratch.pool, scratch.taken
    for number in range(len(out)):
        out[number] = 0.0
    best_rate, fewest_s, choice = 0.0, math.inf, pool[taken[0]].value
    for k in range(selection.count):
        seconds = pool[taken[k]].seconds
        best_rate = max(best_rate, _rate(pool[taken[k]].bits, seconds))
        fewest_s = min(fewest_s, seconds)
        choice = max(choice, pool[taken[k]].value)
    experience.best_rate = max(experience.best_rate, best_rate)
    for k in range(selection.count):
        row, number = out[k * _WIDTH : (k + 1) * _WIDTH], taken[k]
        bits, seconds, value = pool[number].bits, pool[number].seconds, pool[number].value
        rate = _rate(bits, seconds)
        row[_SCORE] = 1.0 if k == 0 else _NEXT_BEST * clip(value / choice)
        row[_CHOSEN] = 1.0 if k == 0 else 0.0
        row[_BITS] = clip(bits / experience.most_bits)
        row[_BITS_LOG] = clip(math.log2(1.0 + bits) / _MOST_LOG_BITS)
        row[_SECONDS] = 1.0 if math.isinf(seconds) else seconds / (seconds + _HALF_SECONDS)
        row[_SOONNESS] = 0.0 if math.isinf(seconds) else clip(fewest_s / seconds)
        row[_RATE] = clip(rate / best_rate)
        row[_RATE_EVER] = clip(rate / experience.best_rate)
        better = 0
        for other in range(selection.count):
            better += int(pool[taken[other]].value > value)
        row[_RANK] = 1.0 - better / max(selection.count - 1, 1)
        row[_KEPT] = 1.0 if number == selection.kept or _is_goal(situation, pool, number) else 0.0
        _write_view(proposer, k, row)
        _write_place(proposer, situation, number, selection, row)


@lean_kernel
def _is_goal(situation, pool, number):
    """Return whether a viewpoint of the pool leads to the far place to which the robot is on its way."""
    if not situation.experience.going or pool[number].kind != _FAR:
        return False
    return distance_apart(pool[number].goal, situation.experience.goal) < 1e-6


@lean_kernel
def _write_view(proposer, k, row):
    """Fill in the features of what candidate k should see."""
    scratch = proposer.scratch
    view, longest = scratch.views[k], proposer.exact.max_range_m / proposer.exact.voxel_size_m
    size = proposer.lattice.size
    longest = min(longest, _diagonal(size))
    seen = max(view.seen, 1)
    row[_AGAIN] = clip(view.again_bits / view.bits)
    row[_UNIQUE] = clip(view.unique / seen)
    row[_COMMON] = clip(scratch.common[k, 0] / seen) if k > 0 else 1.0
    row[_SLIVERS] = clip(view.slivers / seen)
    row[_UNKNOWN] = clip(view.unknown / seen)
    row[_DEPTH] = clip(view.distance / seen / longest)
    row[_ANNOUNCED] = clip(view.shared[0] / view.all_bits)
    row[_SECOND] = clip(view.shared[1] / view.all_bits)
    row[_THIRD] = clip(view.shared[2] / view.all_bits)


@lean_kernel
def _write_place(proposer, situation, number, selection, row):
    """Fill in the features of where a viewpoint of the pool is, and of the way to it."""
    pool, here, size = proposer.scratch.pool, situation.knowledge.pose, situation.belief.size
    at, goal, kind = pool[number].viewpoint, pool[number].goal, pool[number].kind
    diagonal = _diagonal(size)
    row[_ON_SPOT] = 1.0 if kind == _SPOT else 0.0
    row[_IS_NEAR] = 1.0 if kind == _NEAR else 0.0
    row[_IS_FAR] = 1.0 if kind == _FAR else 0.0
    straight, path = distance_apart(goal, here), _path_length(proposer, situation, goal, kind)
    away = _distance_to_remaining(proposer.blocks, goal, selection.remaining)
    row[_ELSEWHERE] = 1.0 - _share_around(proposer, size, goal, selection.remaining)
    row[_ADVANTAGE] = min(max((away - path) / diagonal, -1.0), 1.0)
    row[_DIRECTNESS] = clip(straight / path) if path > 1e-9 else 1.0
    row[_DISTANCE] = clip(straight / diagonal)
    row[_CONTEST] = _contest(proposer, situation, goal, pool[number].seconds)
    row[_TRUST] = trust_in(situation.experience, proposer.all_around, goal)
    along, across = math.cos(here[3]), math.sin(here[3])
    x, y, z = at[0] - here[0], at[1] - here[1], at[2] - here[2]
    row[_AHEAD] = min(max((x * along + y * across) / proposer.reach, -1.0), 1.0)
    row[_LEFT] = min(max((y * along - x * across) / proposer.reach, -1.0), 1.0)
    row[_UP] = min(max(z / proposer.reach, -1.0), 1.0)
    row[_TURN_COS], row[_TURN_SIN] = math.cos(at[3] - here[3]), math.sin(at[3] - here[3])
    row[_PITCH] = min(max(at[4] / (0.5 * math.pi), -1.0), 1.0)


@lean_kernel
def write_context(proposer, situation, selection, out):
    """Fill in the features of a robot's situation.

    Args:
        proposer: See `nearby`, with what was selected.
        situation: See `nearby`.
        selection: Selection.
        out: (C,) float32, filled in.
    """
    known, experience, drive = situation.knowledge, situation.experience, proposer.drive
    pool, taken, size = proposer.scratch.pool, proposer.scratch.taken, situation.belief.size
    most_bits, best_rate, heard, nearest = 0.0, 0.0, 0, math.inf
    for k in range(selection.count):
        bits = pool[taken[k]].bits
        most_bits = max(most_bits, bits)
        best_rate = max(best_rate, _rate(bits, pool[taken[k]].seconds))
    for mate in situation.mates:
        if not mate.silent:
            heard += 1
            nearest = min(nearest, distance_apart(mate.place, known.pose))
    reach_m = proposer.reach * proposer.exact.voxel_size_m
    once_s = driving_time(reach_m, drive.max_speed_m_s, drive.acceleration_m_s2) + drive.scan_time_s
    once_s += 0.5 * math.pi / drive.turn_rate_rad_s
    bits = known.gained_bits + known.heard_bits
    out[_C_ENTROPY] = clip(known.entropy_left)
    out[_C_REPORTED] = clip(known.heard_bits / bits if bits > 0.0 else 0.0)
    out[_C_BITS] = clip(most_bits / experience.most_bits)
    out[_C_RATE] = clip(best_rate / experience.best_rate)
    out[_C_FAR] = clip(selection.far_value / (selection.far_value + selection.near_value))
    out[_C_AROUND] = _share_around(proposer, size, known.pose, selection.remaining)
    out[_C_TIME] = known.time_s / (known.time_s + _HALF_TIME_S)
    out[_C_CANDIDATES] = selection.count / len(taken)
    out[_C_MATES] = known.teammates / (known.teammates + _HALF_MATES)
    out[_C_HEARD] = clip(heard / max(known.teammates, 1))
    out[_C_NEAREST] = clip(nearest / _diagonal(size))
    out[_C_BLOCKED] = 1.0 if experience.blocked > 0 else 0.0
    out[_C_FAILURES] = experience.failures / REMEMBERED
    out[_C_UNDER_WAY] = 1.0 if known.under_way else 0.0
    out[_C_PLANAR] = 1.0 if proposer.planar else 0.0
    out[_C_ALL_AROUND] = 1.0 if proposer.all_around else 0.0
    out[_C_SCAN_TIME] = clip(drive.scan_time_s / once_s)


@lean_kernel
def write_overlaps(proposer, count, out):
    """Fill in the voxels that two candidates both see, as a share of those of the one that sees fewer.

    Args:
        proposer: See `nearby`, with what was selected.
        count: Candidates.
        out: (K·K,) float32, filled in; 1 for a candidate with itself, 0 where there is none.
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
