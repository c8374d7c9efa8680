"""The planner's own choice: the best viewpoint nearby or far away, or a way out where there is none.

All in grid units; `proposer` and `situation` as in `nearby`.
"""

from __future__ import annotations

import math

from entropy_explore_env.belief.paths.search import cost_to
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.far import first_stop, gaze_on_the_way, propose_far
from entropy_explore_env.planner.memory import copy_numbers, distance_apart, trust_and_clearance
from entropy_explore_env.planner.nearby import start_paths
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.states import PlannerState, next_state
from entropy_explore_env.planner.thresholds import (
    ENCLOSED_MARGIN,
    FAILED_SHARE,
    FAR_DECISIONS,
    FAR_DECISIONS_STRAIGHT,
    KEEP_GOAL,
    LOW_GAIN,
    RANDOM_VIEWPOINTS,
    TRIED_STOPS,
)
from entropy_explore_env.randomness import draw_uniform
from entropy_explore_env.viewpoints.evaluation import voxel_at

_DRAWS = 64
"""How often a random place is drawn until it lies within reach."""
_SPOT, _NEAR, _FAR = int(Kind.SPOT), int(Kind.NEAR), int(Kind.FAR)
_LEAVING, _WANDERING = int(PlannerState.LEAVING), int(PlannerState.WANDERING)
_ENCLOSED = int(PlannerState.ENCLOSED)


@lean_kernel
def _looks_far(proposer, situation, best):
    """Return whether far places could be worth more than the best viewpoint nearby, an OPTION."""
    experience, recipe = situation.experience, proposer.recipe
    experience.patience -= 1
    if experience.going:
        return True
    if recipe.far_below < 1.0:
        return best.bits < recipe.far_below * experience.most_bits and experience.patience <= 0
    moved = not experience.looked_far or distance_apart(experience.far_at, situation.knowledge.pose) > 0.5
    return moved or best.value < experience.far_value or experience.patience <= 0


@lean_kernel
def _add_far(proposer, situation, state, size, near, most):
    """Add the first stops on the way to far places to the pool, and find the planner's far choice.

    Args:
        proposer: See `nearby`; paths within reach have been searched.
        situation: See `nearby`.
        state: PlannerState.
        size: Viewpoints in the pool.
        near: Number of the best one of them.
        most: Stops that are added at most.

    Returns:
        (size, choice): viewpoints in the pool then, and the number of the planner's choice.
    """
    scratch, experience, recipe = proposer.scratch, situation.experience, proposer.recipe
    far, pool, choice, first, value = scratch.far, scratch.pool, near, size, scratch.pool[near].value
    count, best = propose_far(proposer, situation, state, pool[near].bits)
    experience.far_value, experience.looked_far = best, True
    copy_numbers(situation.knowledge.pose, experience.far_at)
    experience.patience = FAR_DECISIONS if recipe.far_below >= 1.0 else FAR_DECISIONS_STRAIGHT
    if experience.going and count > 0:
        far[count - 1].value *= KEEP_GOAL
    for tried in range(count):
        number = 0
        for other in range(count):
            if far[other].value > far[number].value:
                number = other
        worth = far[number].value
        if worth <= 0.0 or size - first == most:
            break
        far[number].value = -1.0
        choosing = choice == near and worth > value and tried < TRIED_STOPS
        stop, goal = pool[size].viewpoint, far[number].viewpoint
        if _is_goal_taken(pool[first:size], goal) or not first_stop(proposer, situation, goal, stop):
            continue
        gazes = recipe.waypoint_gazes if choosing else min(recipe.waypoint_gazes, TRIED_STOPS)
        pool[size].stop_bits = gaze_on_the_way(proposer, situation, gazes, goal, stop)
        if trust_and_clearance(proposer, situation, stop) < FAILED_SHARE:
            continue
        copy_numbers(goal, pool[size].goal)
        pool[size].bits, pool[size].seconds = far[number].bits, far[number].seconds
        pool[size].value, pool[size].kind = worth, _FAR
        if choosing:
            choice = size
        size += 1
    return size, choice


@lean_kernel
def _is_goal_taken(options, goal):
    """Return whether one of some far viewpoints leads to the same place."""
    for number in range(len(options)):
        if distance_apart(options[number].goal, goal) < 0.5:
            return True
    return False


@lean_kernel
def _is_reached(proposer, situation, at):
    """Return whether the latest search reached the voxel of a place in the workspace."""
    size = situation.belief.size
    for axis in range(3):
        if not 0.0 < at[axis] < size[axis]:
            return False
    return cost_to(proposer.scratch.search, voxel_at(size, at)) < math.inf


@lean_kernel
def _put_beside(proposer, situation, step, at):
    """Write the viewpoint on the voxel that lies some steps (x, y, z) from the robot's."""
    here = situation.knowledge.pose
    copy_numbers(here, at)
    for axis in range(proposer.axes):
        at[axis] = math.floor(here[axis]) + 0.5 + step[axis]


@lean_kernel
def _is_enclosed(proposer, situation):
    """Return whether no path leads the robot away from the voxels that its body touches, by its belief."""
    extent = 0
    for offset in proposer.lattice.footprint:
        for axis in range(3):
            extent = max(extent, abs(offset[axis]))
    half, at = extent + ENCLOSED_MARGIN, proposer.scratch.at
    layers = 0 if proposer.planar else half
    for x in range(-half, half + 1):
        for y in range(-half, half + 1):
            for z in range(-layers, layers + 1):
                if max(abs(x), abs(y), abs(z)) == half:
                    _put_beside(proposer, situation, (x, y, z), at)
                    if _is_reached(proposer, situation, at):
                        return False
    return True


@lean_kernel
def _find_exit(proposer, situation, out):
    """Fill in (5,) a neighbouring voxel through which an enclosed robot may leave.

    The way out is the way that it came: of those that the search reached and that did not fail, the nearest
    to where it was last free; else a random one.

    Returns:
        Whether there is any.
    """
    experience, at = situation.experience, proposer.scratch.at
    knows_free = experience.was_free and distance_apart(experience.free_at, situation.knowledge.pose) >= 1.0
    layers, best, found = 0 if proposer.planar else 1, math.inf, False
    for x in range(-1, 2):
        for y in range(-1, 2):
            for z in range(-layers, layers + 1):
                if x == 0 and y == 0 and z == 0:
                    continue
                _put_beside(proposer, situation, (x, y, z), at)
                if not _is_reached(proposer, situation, at):
                    continue
                if trust_and_clearance(proposer, situation, at) > 0.0:
                    away = draw_uniform(experience.candidates_rng)
                    if knows_free:
                        away = distance_apart(experience.free_at, at)
                    if away < best:
                        best, found = away, True
                        copy_numbers(at, out)
    return found


@lean_kernel
def _draw_within_reach(proposer, situation, at):
    """Draw a viewpoint, uniform within reach and inside the workspace, with any gaze."""
    rng, here, size, reach = (
        situation.experience.candidates_rng,
        situation.knowledge.pose,
        situation.belief.size,
        proposer.reach,
    )
    copy_numbers(here, at)
    for _ in range(_DRAWS):
        squared = 0.0
        for axis in range(proposer.axes):
            low = max(min(0.5, here[axis]), here[axis] - reach)
            high = min(max(size[axis] - 0.5, here[axis]), here[axis] + reach)
            at[axis] = low + (high - low) * draw_uniform(rng)
            squared += (at[axis] - here[axis]) ** 2
        if squared <= reach * reach:
            break
        copy_numbers(here, at)
    at[3] = math.pi * (2.0 * draw_uniform(rng) - 1.0)
    if not proposer.level:
        at[4] = math.asin(2.0 * draw_uniform(rng) - 1.0)


@lean_kernel
def _draw_random(proposer, situation, out):
    """Fill in (5,) the most trusted of some random viewpoints, to which a path leads past teammates."""
    at, best = proposer.scratch.at, -1.0
    for _ in range(RANDOM_VIEWPOINTS):
        _draw_within_reach(proposer, situation, at)
        trust = trust_and_clearance(proposer, situation, at)
        if proposer.planned and not _is_reached(proposer, situation, at):
            trust = 0.0
        if trust > best:
            best = trust
            copy_numbers(at, out)
    if best <= 0.0 and proposer.planned:
        _find_exit(proposer, situation, out)


@lean_kernel
def choose(proposer, situation, state, size, most_far):
    """Add to the pool what the planner needs beside the viewpoints nearby, and choose as it does.

    Args:
        proposer: See `nearby`; the best viewpoint nearby is the first of `scratch.order`.
        situation: See `nearby`.
        state: PlannerState after the latest scan.
        size: Viewpoints in the pool, all nearby.
        most_far: Far places that are added at most.

    Returns:
        (size, choice): viewpoints in the pool then, and the number of the planner's own choice.
    """
    pool, experience, here = proposer.scratch.pool, situation.experience, situation.knowledge.pose
    best = proposer.scratch.order[0]
    experience.most_bits = max(experience.most_bits, pool[best].bits)
    if _looks_far(proposer, situation, pool[best]):
        if not proposer.planned:
            start_paths(proposer, situation)
        size, best = _add_far(proposer, situation, state, size, best, most_far)
        experience.most_bits = max(experience.most_bits, pool[best].bits)
    bits, other, encloses = pool[best].stop_bits, pool[size].viewpoint, False
    stays = distance_apart(pool[best].viewpoint, here) == 0.0
    if proposer.planned and stays and bits < LOW_GAIN * experience.most_bits:
        if _is_enclosed(proposer, situation):
            encloses = _find_exit(proposer, situation, other)
        else:
            experience.was_free = True
            copy_numbers(here, experience.free_at)
    gives_way = not encloses and experience.blocked > 0 and draw_uniform(experience.candidates_rng) < 0.5
    state = next_state(experience.low_gain_scans, state == _LEAVING, bits, encloses, gives_way)
    if state == _WANDERING:
        _draw_random(proposer, situation, other)
    elif state != _ENCLOSED:
        return size, best
    copy_numbers(other, pool[size].goal)
    pool[size].bits, pool[size].stop_bits, pool[size].value = 0.0, 0.0, 0.0
    pool[size].seconds = math.inf
    pool[size].kind = _NEAR if distance_apart(other, here) > 0.0 else _SPOT
    return size + 1, size
