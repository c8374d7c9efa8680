"""A robot's candidates, from what it knows: drawn, refined, chosen, selected, and described."""

from __future__ import annotations

import math

from entropy_explore_env.belief.visibility import mark_cones
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.choice import choose
from entropy_explore_env.planner.far_places import fill_remaining
from entropy_explore_env.planner.features import Selection
from entropy_explore_env.planner.memory import chosen_number, copy_numbers, distance_apart, learn, weigh_time
from entropy_explore_env.planner.nearby import evaluate, propose_nearby, start_paths
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.selection import most_far_of, select
from entropy_explore_env.planner.thresholds import KEEP_GOAL
from entropy_explore_env.viewpoints.expected_scan import expected_bits

_NONE, _FAR = int(Kind.NONE), int(Kind.FAR)


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
    mark_cones(situation.cones, belief.size, scratch.scan.left, 1)
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
    mark_cones(situation.cones, belief.size, scratch.scan.left, 0)
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
    if math.isinf(proposer.exact.wanted_precision) or chosen < 0 or knowledge.under_way:
        return knowledge.came_bits
    left = expected_bits(situation.belief, proposer.exact, knowledge.target, proposer.scratch.scan)
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
    evaluate(proposer, situation, proposer.exact, options, False)
    if experience.going:
        copy_numbers(experience.goal, options[0].goal)
        options[0].kind = _FAR


@lean_kernel
def _pull_within(proposer, here, at):
    """Pull a viewpoint within reach of where the robot is."""
    length = distance_apart(at, here)
    if length > proposer.reach:
        for axis in range(3):
            at[axis] = here[axis] + (at[axis] - here[axis]) * proposer.reach / length
