"""Which viewpoints become a robot's candidates: the planner's own choice, and others that differ from it."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.paths.search import cost_to
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.far import first_stop, gaze_on_the_way, propose_far
from entropy_explore_env.planner.nearby import copy_viewpoint, start_paths, value_of, voxel_at
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.situation import (
    distance_apart,
    trust_and_clearance,
    turned,
    worth_bits,
)
from entropy_explore_env.planner.thresholds import (
    DISAPPOINTING,
    ELSEWHERE,
    FAR_EVERY,
    NOTHING_BITS,
    PATIENCE,
    POOR,
    TRIED_STOPS,
)
from entropy_explore_env.planner.views import clear_marks, look_from, mark_view
from entropy_explore_env.randomness import draw_uniform

_FAR_SHARE = 4
"""One in so many candidates, at least one, may be far."""
_NEAR_SHARE = 4
"""One in so many candidates may be a place within reach that is worth less than gazes on the spot."""
_AWAY = 2
"""Who gets so many voxels beyond what its body touches is not shut in."""
_DRAWS = 64
"""How often a place elsewhere is drawn until it lies within reach."""
_ALIKE_REACH, _ALIKE_WIDTH = 0.1, 0.25
"""Viewpoints nearer than this, in reaches and in widths of the view, are alike."""
MOST_COMMON = 0.9
"""Largest share of the voxels of either of two candidates that both may see."""
_SPOT, _NEAR, _FAR = int(Kind.SPOT), int(Kind.NEAR), int(Kind.FAR)


@lean_kernel
def _looks_far(proposer, situation, value, bits):
    """Whether far places could be worth more than a viewpoint nearby."""
    experience, recipe = situation.experience, proposer.recipe
    experience.patience -= 1
    if experience.going:
        return True
    if recipe.far_below < 1.0:
        return bits < recipe.far_below * experience.most_bits and experience.patience <= 0
    moved = not experience.looked_far or distance_apart(experience.far_at, situation.here) > 0.5
    return moved or value < experience.far_value or experience.patience <= 0


@lean_kernel
def add_far(proposer, situation, size, value, bits, most):
    """Add the first stops on the way to far places to the pool, and find the planner's far choice.

    Args:
        proposer: A Proposer; paths within reach have been searched.
        situation: A Situation.
        size: Viewpoints in the pool.
        value: What the best one nearby is worth.
        bits: That it should bring.
        most: Stops that are added at most.

    Returns:
        (size, choice): viewpoints in the pool then, and the number of the one that the planner chooses;
        -1 = one nearby is worth more.
    """
    scratch, experience, recipe = proposer.scratch, situation.experience, proposer.recipe
    count, best = propose_far(proposer, situation, bits)
    experience.far_value, experience.looked_far = best, True
    for axis in range(3):
        experience.far_at[axis] = situation.here[axis]
    experience.patience = FAR_EVERY if recipe.far_below >= 1.0 else PATIENCE
    far, pool, choice, first = scratch.far, scratch.pool, -1, size
    if experience.going and count > 0:
        far.values[count - 1] *= recipe.keep
    for tried in range(count):
        number = 0
        for other in range(count):
            if far.values[other] > far.values[number]:
                number = other
        worth = far.values[number]
        if worth <= 0.0 or size - first == most:
            break
        far.values[number] = -1.0
        choosing = choice < 0 and worth > value and tried < TRIED_STOPS
        stop, goal = pool.viewpoints[size], far.viewpoints[number]
        if _goal_taken(pool, first, size, goal) or not first_stop(proposer, situation, goal, stop):
            continue
        gazes = recipe.waypoint_gazes if choosing else min(recipe.waypoint_gazes, TRIED_STOPS)
        pool.stop_bits[size] = gaze_on_the_way(proposer, situation, gazes, goal, stop)
        if trust_and_clearance(proposer, situation, stop) < DISAPPOINTING:
            continue
        copy_viewpoint(goal, pool.goals[size])
        pool.bits[size], pool.seconds[size] = far.bits[number], far.seconds[number]
        pool.values[size], pool.kinds[size] = worth, _FAR
        if choosing:
            choice = size
        size += 1
    return size, choice


@lean_kernel
def _goal_taken(pool, first, size, goal):
    """Whether one of the far viewpoints `first` … `size` - 1 of the pool is at the same place."""
    for number in range(first, size):
        if distance_apart(pool.goals[number], goal) < 0.5:
            return True
    return False


@lean_kernel
def _is_reached(proposer, situation, at):
    """Whether the latest search reached the voxel of a place in the workspace."""
    size = situation.belief.size
    for axis in range(3):
        if not 0.0 < at[axis] < size[axis]:
            return False
    return cost_to(proposer.scratch.search, voxel_at(size, at)) < math.inf


@lean_kernel
def _neighbour(proposer, situation, step, at):
    """Write the viewpoint on the voxel that lies some steps (x, y, z) from the robot's."""
    here = situation.here
    copy_viewpoint(here, at)
    for axis in range(proposer.axes):
        at[axis] = math.floor(here[axis]) + 0.5 + step[axis]


@lean_kernel
def _is_shut_in(proposer, situation):
    """Whether no path leads the robot away from the voxels that its body touches, by its belief."""
    extent = 0
    for offset in proposer.lattice.footprint:
        for axis in range(3):
            extent = max(extent, abs(offset[axis]))
    half, at = extent + _AWAY, proposer.scratch.gazes[0]
    layers = 0 if proposer.planar else half
    for x in range(-half, half + 1):
        for y in range(-half, half + 1):
            for z in range(-layers, layers + 1):
                if max(abs(x), abs(y), abs(z)) == half:
                    _neighbour(proposer, situation, (x, y, z), at)
                    if _is_reached(proposer, situation, at):
                        return False
    return True


@lean_kernel
def _find_exit(proposer, situation, out):
    """Fill in (5,) a neighbouring voxel through which a robot that is shut in may leave.

    The way out is the way that it came: of those that the search reached and that did not fail, the nearest
    to where it was last free; else a random one.

    Returns:
        Whether there is any.
    """
    experience, at = situation.experience, proposer.scratch.gazes[0]
    from_free = experience.was_free and distance_apart(experience.free_at, situation.here) >= 1.0
    layers, best, found = 0 if proposer.planar else 1, math.inf, False
    for x in range(-1, 2):
        for y in range(-1, 2):
            for z in range(-layers, layers + 1):
                if x == 0 and y == 0 and z == 0:
                    continue
                _neighbour(proposer, situation, (x, y, z), at)
                if not _is_reached(proposer, situation, at):
                    continue
                if trust_and_clearance(proposer, situation, at) > 0.0:
                    away = draw_uniform(experience.candidates_rng)
                    if from_free:
                        away = distance_apart(experience.free_at, at)
                    if away < best:
                        best, found = away, True
                        copy_viewpoint(at, out)
    return found


@lean_kernel
def _draw_elsewhere(proposer, situation, out):
    """Fill in (5,) a random viewpoint: of some, one that a path leads to, past all teammates."""
    rng, here, at = situation.experience.candidates_rng, situation.here, proposer.scratch.gazes[0]
    size, axes, best = situation.belief.size, proposer.axes, -1.0
    for _ in range(ELSEWHERE):
        copy_viewpoint(here, at)
        for _ in range(_DRAWS):
            squared = 0.0
            for axis in range(axes):
                low = max(min(0.5, here[axis]), here[axis] - proposer.reach)
                high = min(max(size[axis] - 0.5, here[axis]), here[axis] + proposer.reach)
                at[axis] = low + (high - low) * draw_uniform(rng)
                squared += (at[axis] - here[axis]) ** 2
            if squared <= proposer.reach * proposer.reach:
                break
            copy_viewpoint(here, at)
        at[3] = math.pi * (2.0 * draw_uniform(rng) - 1.0)
        if not proposer.level:
            at[4] = math.asin(2.0 * draw_uniform(rng) - 1.0)
        trust = trust_and_clearance(proposer, situation, at)
        if proposer.planned and not _is_reached(proposer, situation, at):
            trust = 0.0
        if trust > best:
            best = trust
            copy_viewpoint(at, out)
    if best <= 0.0 and proposer.planned:
        _find_exit(proposer, situation, out)


@lean_kernel
def choose(proposer, situation, size, most_far):
    """Add to the pool what the planner needs beside the viewpoints nearby, and choose as it does.

    Args:
        proposer: A Proposer; the best viewpoint nearby is the first of `scratch.found`.
        situation: A Situation.
        size: Viewpoints in the pool, all nearby.
        most_far: Far places that are added at most.

    Returns:
        (size, choice): viewpoints in the pool then, and the number of the planner's own choice.
    """
    pool, experience = proposer.scratch.pool, situation.experience
    best = proposer.scratch.found[0]
    value, bits = pool.values[best], pool.bits[best]
    experience.most_bits = max(experience.most_bits, bits)
    if _looks_far(proposer, situation, value, bits):
        if not proposer.planned:
            start_paths(proposer, situation)
        size, far = add_far(proposer, situation, size, value, bits, most_far)
        if far >= 0:
            experience.most_bits = max(experience.most_bits, pool.bits[far])
            best = far
    expected, odd = pool.stop_bits[best], pool.viewpoints[size]
    stays = distance_apart(pool.viewpoints[best], situation.here) == 0.0
    leaves = False
    if proposer.planned and stays and expected < POOR * experience.most_bits:
        if _is_shut_in(proposer, situation):
            leaves = _find_exit(proposer, situation, odd)
        else:
            experience.was_free = True
            for axis in range(3):
                experience.free_at[axis] = situation.here[axis]
    if not leaves:
        wanders = experience.blocked > 0 and draw_uniform(experience.candidates_rng) < 0.5
        if expected > NOTHING_BITS and not wanders:
            return size, best
        _draw_elsewhere(proposer, situation, odd)
    _add_odd(proposer, situation, size)
    return size + 1, size


@lean_kernel
def _add_odd(proposer, situation, number):
    """Fill in a viewpoint of the pool that is not chosen for its bits."""
    pool = proposer.scratch.pool
    at = pool.viewpoints[number]
    copy_viewpoint(at, pool.goals[number])
    pool.bits[number], pool.stop_bits[number], pool.values[number] = 0.0, 0.0, 0.0
    pool.seconds[number] = math.inf
    pool.kinds[number] = _NEAR if distance_apart(at, situation.here) > 0.0 else _SPOT


@lean_kernel
def _alike(proposer, at, other):
    """Whether two viewpoints hardly differ."""
    if distance_apart(at, other) >= _ALIKE_REACH * proposer.within:
        return False
    if proposer.all_around:
        return True
    apart = _ALIKE_WIDTH * proposer.view_width_rad
    return turned(at[3], other[3]) * math.cos(at[4]) < apart and abs(at[4] - other[4]) < apart


@lean_kernel
def _is_other(proposer, number, count):
    """Whether a viewpoint of the pool is no candidate yet, and differs from all of them."""
    pool, taken = proposer.scratch.pool, proposer.scratch.taken
    for place in range(count):
        other = taken[place]
        if other == number:
            return False
        both_near = pool.kinds[other] != _FAR and pool.kinds[number] != _FAR
        if both_near and _alike(proposer, pool.viewpoints[number], pool.viewpoints[other]):
            return False
    return True


@lean_kernel
def select(proposer, situation, size, choice, kept):
    """Select the candidates out of the pool: their numbers are left in `scratch.taken`, the choice first.

    Far ones come next; then a quarter may be the best places within reach, and the rest is what is worth
    most of all nearby. None sees much the same as another.

    Args:
        proposer: A Proposer.
        situation: A Situation.
        size: Viewpoints in the pool.
        choice: The number of the planner's own choice.
        kept: Number of one that is taken in any case; -1 = none.

    Returns:
        How many there are.
    """
    scratch, belief = proposer.scratch, situation.belief
    pool, taken, order = scratch.pool, scratch.taken, scratch.found
    most, count, marked = len(taken), 0, 0
    tries, places = 2 * most, most // _NEAR_SHARE
    for k in range(size):
        order[k] = k
    for place in range(-2, size):
        must = place < 0
        number = choice if place == -2 else kept
        if must and (number < 0 or (place == -1 and kept == choice)):
            continue
        if not must:
            _bring_first(pool, order, place, size, places > 0)
            number = order[place]
            if pool.values[number] <= 0.0 or not _is_other(proposer, number, count):
                continue
        if count == most or tries == 0:
            break
        tries -= 1
        most_common = 2.0 if must else MOST_COMMON
        if look_from(proposer, situation, pool.goals[number], count, most_common):
            taken[count] = number
            marked = mark_view(proposer, belief, count, marked)
            _note_exactly(proposer, situation, number, scratch.views[count].bits)
            count += 1
            places -= int(pool.kinds[number] == _NEAR)
    clear_marks(proposer, marked)
    return count


@lean_kernel
def _note_exactly(proposer, situation, number, bits):
    """Put the bits that all rays should bring in place of those of fewer; not of what has no path."""
    pool = proposer.scratch.pool
    if pool.seconds[number] < math.inf:
        pool.bits[number] = worth_bits(proposer, situation, pool.goals[number], bits)
        if proposer.recipe.path_scans == 0:
            pool.values[number] = value_of(situation, pool.bits[number], pool.seconds[number])
        if pool.kinds[number] != _FAR:
            pool.stop_bits[number] = pool.bits[number]


@lean_kernel
def _bring_first(pool, order, place, size, places):
    """Bring the number of what comes first of the rest of the pool to a place of the order."""
    first = place
    for other in range(place + 1, size):
        if _comes_first(pool, order[other], order[first], places):
            first = other
    order[place], order[first] = order[first], order[place]


@lean_kernel
def _comes_first(pool, number, other, places):
    """Whether a viewpoint of the pool is looked at before another: far ones, then `places`, then by value."""
    kind, other_kind = pool.kinds[number], pool.kinds[other]
    if kind != other_kind and (kind == _FAR or other_kind == _FAR):
        return kind == _FAR
    if kind != other_kind and places:
        return kind == _NEAR
    return pool.values[number] > pool.values[other]


@lean_kernel
def most_far_of(candidates):
    """How many of so many candidates may be far."""
    return max(np.int64(candidates) // _FAR_SHARE, 1)
