"""Which viewpoints of the pool become a robot's candidates: the planner's choice, and others that differ."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.raycast import distance_between
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.memory import value_of, worth_bits
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.thresholds import (
    ALIKE_REACH,
    ALIKE_WIDTH,
    FAR_SHARE,
    MOST_COMMON,
    NEAR_SHARE,
)
from entropy_explore_env.planner.views import clear_marks, look_from, mark_view
from entropy_explore_env.robots.pose_covariance import turn_between

_NEAR, _FAR = int(Kind.NEAR), int(Kind.FAR)
_WHATEVER = 2.0
"""Share of common voxels that no candidate exceeds."""


@lean_kernel
def most_far_of(candidates):
    """Return how many of a number of candidates may be far."""
    return max(np.int64(candidates) // FAR_SHARE, 1)


@lean_kernel
def select(proposer, situation, size, choice, kept):
    """Select the candidates out of the pool: their numbers are left in `scratch.taken`, the choice first.

    Far ones come next; then a quarter may be the best places within reach, and the rest is what is worth
    most of all nearby. None sees much the same as another.

    Args:
        proposer: See `model`.
        situation: See `model`.
        size: Viewpoints in the pool.
        choice: Number of the planner's own choice.
        kept: Number of one that is taken in any case; -1 = none.

    Returns:
        How many candidates there are.
    """
    scratch = proposer.scratch
    pool, order, most = scratch.pool, scratch.order, len(scratch.taken)
    count, marked = _take(proposer, situation, choice, 0, 0, _WHATEVER)
    places = most // NEAR_SHARE - int(pool[choice].kind == _NEAR)
    if kept >= 0 and kept != choice and count < most:
        count, marked = _take(proposer, situation, kept, count, marked, _WHATEVER)
        places -= int(pool[kept].kind == _NEAR)
    tries = 2 * most - count
    for k in range(size):
        order[k] = k
    for place in range(size):
        if count == most or tries == 0:
            break
        _bring_first(pool, order, place, size, places > 0)
        number = order[place]
        if pool[number].value > 0.0 and _is_other(proposer, number, count):
            tries, before = tries - 1, count
            count, marked = _take(proposer, situation, number, count, marked, MOST_COMMON)
            places -= int(count > before and pool[number].kind == _NEAR)
    clear_marks(proposer, count, marked)
    return count


@lean_kernel
def _take(proposer, situation, number, count, marked, most_common):
    """Make a viewpoint of the pool a candidate unless it sees much the same as one of `count` others.

    Returns:
        (count, marked): the candidates then, and the voxels in `scratch.seen`.
    """
    scratch, belief = proposer.scratch, situation.belief
    option = scratch.pool[number]
    if not look_from(proposer, situation, option.goal, count, most_common):
        return count, marked
    scratch.taken[count] = number
    marked = mark_view(proposer, belief, count, marked)
    if option.seconds < math.inf:  # put what all rays should bring in place of what fewer should
        option.bits = worth_bits(proposer, situation, option.goal, scratch.views[count].bits)
        option.value = value_of(proposer, situation, option.bits, option.seconds)
        if option.kind != _FAR:
            option.stop_bits = option.bits
    return count + 1, marked


@lean_kernel
def _is_other(proposer, number, count):
    """Return whether a viewpoint of the pool is no candidate yet, and differs from all of them."""
    pool, taken = proposer.scratch.pool, proposer.scratch.taken
    for place in range(count):
        other = taken[place]
        if other == number:
            return False
        both_near = pool[other].kind != _FAR and pool[number].kind != _FAR
        if both_near and _is_alike(proposer, pool[number].viewpoint, pool[other].viewpoint):
            return False
    return True


@lean_kernel
def _is_alike(proposer, at, other):
    """Return whether two viewpoints hardly differ."""
    if distance_between(at, other) >= ALIKE_REACH * proposer.within:
        return False
    if proposer.all_around:
        return True
    apart = ALIKE_WIDTH * proposer.view_width_rad
    return turn_between(other[3], at[3]) * math.cos(at[4]) < apart and abs(at[4] - other[4]) < apart


@lean_kernel
def _bring_first(pool, order, place, size, places):
    """Bring the number of what comes first of the rest of the pool to a place of the order."""
    first = place
    for other in range(place + 1, size):
        if _comes_first(pool[order[other]], pool[order[first]], places):
            first = other
    order[place], order[first] = order[first], order[place]


@lean_kernel
def _comes_first(option, other, places):
    """Return whether one OPTION is looked at before another: far ones, then `places`, then by value."""
    if option.kind != other.kind and (option.kind == _FAR or other.kind == _FAR):
        return option.kind == _FAR
    if option.kind != other.kind and places:
        return option.kind == _NEAR
    return option.value > other.value
