"""A robot's candidates, from what it knows: drawn, refined, chosen, selected, and described.

The planner's own choice is the best viewpoint nearby or far away. Where no viewpoint is worth a scan, it is a
random way out.
"""

from __future__ import annotations

import math

from entropy_explore_env.belief.raycast import distance_between
from entropy_explore_env.belief.visibility import mark_cones
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.far import first_stop, gaze_on_the_way, propose_far
from entropy_explore_env.planner.far_places import fill_remaining
from entropy_explore_env.planner.features import Selection
from entropy_explore_env.planner.memory import (
    chosen_number,
    copy_numbers,
    learn,
    trust_and_clearance,
    weigh_time,
    worth_bits,
)
from entropy_explore_env.planner.nearby import (
    cost_of,
    draw_viewpoint,
    evaluate,
    propose_nearby,
    start_paths,
)
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.selection import most_far_of, select
from entropy_explore_env.planner.states import PlannerState, next_state
from entropy_explore_env.planner.thresholds import (
    FAILED_SHARE,
    FAR_DECISIONS,
    FAR_DECISIONS_STRAIGHT,
    KEEP_GOAL,
    RANDOM_VIEWPOINTS,
    TRIED_STOPS,
)
from entropy_explore_env.randomness import draw_uniform
from entropy_explore_env.viewpoints.expected_scan import expected_bits

_NONE, _SPOT, _NEAR, _FAR = int(Kind.NONE), int(Kind.SPOT), int(Kind.NEAR), int(Kind.FAR)
_LEAVING, _WANDERING = int(PlannerState.LEAVING), int(PlannerState.WANDERING)


@lean_kernel
def _looks_far(proposer, situation, best):
    """Return whether far places could be worth more than the best viewpoint nearby, an OPTION."""
    experience, recipe = situation.experience, proposer.recipe
    experience.patience -= 1
    if experience.going:
        return True
    if recipe.far_below < 1.0:
        return best.bits < recipe.far_below * experience.most_bits and experience.patience <= 0
    moved = not experience.looked_far or distance_between(experience.far_at, situation.knowledge.pose) > 0.5
    return moved or best.value < experience.far_value or experience.patience <= 0


@lean_kernel
def _add_far(proposer, situation, state, size, near, most):
    """Add at most `most` first stops to far places to the pool, whose best of `size` viewpoints is `near`.

    Returns:
        (size, choice): viewpoints in the pool then, and the number of the planner's choice.
    """
    scratch, experience, recipe = proposer.scratch, situation.experience, proposer.recipe
    far, pool, choice, first, value = scratch.far, scratch.pool, near, size, scratch.pool[near].value
    count, best = propose_far(proposer, situation, state)
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
        if distance_between(options[number].goal, goal) < 0.5:
            return True
    return False


@lean_kernel
def _is_reached(proposer, situation, at):
    """Return whether the latest search reached the voxel of a place in the workspace."""
    size = situation.belief.size
    for axis in range(3):
        if not 0.0 < at[axis] < size[axis]:
            return False
    return cost_of(proposer, situation, at) < math.inf


@lean_kernel
def _find_exit(proposer, situation, out):
    """Fill in (5,) a random one of the neighbouring voxels that the search reached and that did not fail."""
    here, at, best = situation.knowledge.pose, proposer.scratch.at, 1.0
    layers = 0 if proposer.planar else 1
    for x in range(-1, 2):
        for y in range(-1, 2):
            for z in range(-layers, layers + 1):
                copy_numbers(here, at)
                step = (x, y, z)
                for axis in range(proposer.axes):
                    at[axis] = math.floor(here[axis]) + 0.5 + step[axis]
                inside = x == 0 and y == 0 and z == 0
                if inside or not _is_reached(proposer, situation, at):
                    continue
                drawn = draw_uniform(situation.experience.candidates_rng)
                if drawn < best and trust_and_clearance(proposer, situation, at) > 0.0:
                    best = drawn
                    copy_numbers(at, out)


@lean_kernel
def _draw_random(proposer, situation, out):
    """Fill in (5,) the most trusted of some random viewpoints, to which a path leads past teammates."""
    rng, at, best = situation.experience.candidates_rng, proposer.scratch.at, -1.0
    for _ in range(RANDOM_VIEWPOINTS):
        draw_viewpoint(proposer, situation, rng, at)
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
        proposer: See `model`; the best viewpoint nearby is the first of `scratch.order`.
        situation: See `model`.
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
    gives_way = experience.blocked > 0 and draw_uniform(experience.candidates_rng) < 0.5
    bits, other = pool[best].stop_bits, pool[size].viewpoint
    if next_state(experience.low_gain_scans, state == _LEAVING, bits, gives_way) != _WANDERING:
        return size, best
    _draw_random(proposer, situation, other)
    copy_numbers(other, pool[size].goal)
    pool[size].bits, pool[size].stop_bits, pool[size].value = 0.0, 0.0, 0.0
    pool[size].seconds = math.inf
    pool[size].kind = _NEAR if distance_between(other, here) > 0.0 else _SPOT
    return size + 1, size


@lean_kernel
def propose(proposer, situation, candidates, described):
    """Propose candidates to a robot, and return a Selection; what they are is left in `proposer.scratch`.

    Args:
        proposer: See `model`.
        situation: See `model`.
        candidates: (K,) CANDIDATE in grid units, those among which it chose; replaced.
        described: Whether features will be written.
    """
    knowledge, experience, scratch = situation.knowledge, situation.experience, proposer.scratch
    belief, pool = situation.belief, scratch.pool
    mark_cones(situation.cones, belief.size, scratch.scan.left)
    chosen = chosen_number(candidates, knowledge.target)
    came_bits = _came_bits(proposer, situation, candidates, chosen)
    learn(experience, candidates, knowledge, chosen, came_bits, proposer.drive.body_radius)
    state = weigh_time(proposer.recipe, experience, knowledge)
    if proposer.planned:
        start_paths(proposer, situation)
    size = propose_nearby(proposer, situation)
    size, choice = choose(proposer, situation, state, size, most_far_of(len(candidates)))
    kept = -1
    if knowledge.under_way:
        kept, size = size, size + 1
        _keep_target(proposer, situation, kept)
        if pool[choice].value <= KEEP_GOAL * pool[kept].value:
            choice = kept
    count = select(proposer, situation, size, choice, kept)
    if len(situation.cones) > 0:
        scratch.scan.left[:] = 0
    remaining = 0.0
    if described:
        remaining = fill_remaining(belief, proposer.target_precision, proposer.blocks)
    for k in range(len(candidates)):
        option, candidate = pool[scratch.taken[k if k < count else 0]], candidates[k]
        _pull_within(proposer, knowledge.pose, option.viewpoint)
        copy_numbers(option.viewpoint, candidate.viewpoint)
        copy_numbers(option.goal, candidate.goal)
        candidate.bits = option.stop_bits
        candidate.kind = option.kind if k < count else _NONE
    return Selection(count, kept, remaining)


@lean_kernel
def _came_bits(proposer, situation, candidates, chosen):
    """Return the bits that the latest scan brought, of those that count.

    Where only unknown voxels count, they are what the same view promises less than before: a scan of known
    walls brings bits, too, however often it is taken.
    """
    knowledge = situation.knowledge
    if math.isinf(proposer.refined.wanted_precision) or chosen < 0 or knowledge.under_way:
        return knowledge.came_bits
    left = expected_bits(situation.belief, proposer.refined, knowledge.target, proposer.scratch.scan)
    return candidates[chosen].bits - left


@lean_kernel
def _keep_target(proposer, situation, number):
    """Add the viewpoint that a robot under way is driving to, pulled within its reach, to the pool."""
    knowledge, experience = situation.knowledge, situation.experience
    options = proposer.scratch.pool[number : number + 1]
    at = options[0].viewpoint
    copy_numbers(knowledge.target, at)
    for axis in range(3):
        at[axis] = min(max(at[axis], 0.0), float(situation.belief.size[axis]))
    _pull_within(proposer, knowledge.pose, at)
    evaluate(proposer, situation, proposer.refined, options, False)
    if options[0].seconds == math.inf:  # what came is still compared with what its scan should bring
        bits = expected_bits(situation.belief, proposer.refined, at, proposer.scratch.scan)
        options[0].bits = options[0].stop_bits = worth_bits(proposer, situation, at, bits)
    if experience.going:
        copy_numbers(experience.goal, options[0].goal)
        options[0].kind = _FAR


@lean_kernel
def _pull_within(proposer, here, at):
    """Pull a viewpoint within reach of where the robot is."""
    length = distance_between(at, here)
    if length > proposer.reach:
        for axis in range(3):
            at[axis] = here[axis] + (at[axis] - here[axis]) * proposer.reach / length
