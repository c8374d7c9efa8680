"""A robot's candidates, from what it knows: drawn, refined, chosen, selected, and described."""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.far import remaining_bits_by_block
from entropy_explore_env.planner.features import Selection
from entropy_explore_env.planner.nearby import (
    copy_viewpoint,
    evaluate,
    propose_nearby,
    start_paths,
)
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.selection import choose, most_far_of, select
from entropy_explore_env.planner.situation import (
    chosen_number,
    distance_apart,
    learn,
    weigh_time,
)
from entropy_explore_env.viewpoints.imagined_scan import imagined_bits

_NONE, _FAR = int(Kind.NONE), int(Kind.FAR)


@lean_kernel
def propose(proposer, situation, decision, candidates, described):
    """Propose candidates to a robot; what they are is left in `proposer.scratch`.

    Args:
        proposer: A Proposer of the robot's kind.
        situation: A Situation; its experience is changed in place.
        decision: LastDecision of the robot.
        candidates: (K,) CANDIDATE, those among which it chose; replaced, in grid units.
        described: Whether features will be written.

    Returns:
        Selection.
    """
    experience, pool = situation.experience, proposer.scratch.pool
    chosen = chosen_number(candidates, decision)
    came_bits = _came_bits(proposer, situation, candidates, decision, chosen)
    learn(experience, candidates, decision, chosen, came_bits, situation.here, proposer.drive.body_radius)
    weigh_time(proposer, experience, decision)
    if proposer.planned:
        start_paths(proposer, situation)
    size = propose_nearby(proposer, situation)
    near_value = pool.values[proposer.scratch.found[0]]
    near = size
    size, choice = choose(proposer, situation, size, most_far_of(len(candidates)))
    far_value = 0.0
    for k in range(near, size):
        if pool.kinds[k] == _FAR:
            far_value = max(far_value, pool.values[k])
    kept = -1
    if decision.under_way:
        kept, size = size, size + 1
        _keep_target(proposer, situation, decision, kept)
        if pool.values[choice] <= proposer.recipe.keep * pool.values[kept]:
            choice = kept
    count = select(proposer, situation, size, choice, kept)
    remaining = remaining_bits_by_block(proposer, situation.belief) if described else 0.0
    _write_candidates(proposer, situation.here, candidates, count)
    return Selection(count, kept, near_value, far_value, remaining)


@lean_kernel
def _came_bits(proposer, situation, candidates, decision, chosen):
    """Bits that the latest scan brought, of those that count.

    Where only unknown voxels count, they are what the same view promises less than before: a scan of known
    walls brings bits, too, however often it is taken.
    """
    if math.isinf(proposer.exact.wanted_precision) or chosen < 0 or decision.under_way:
        return decision.came_bits
    left, gap = proposer.scratch.gaze_bits[:1], proposer.recipe.gap_probability
    viewpoint = proposer.scratch.gazes[:1]
    copy_viewpoint(decision.target, viewpoint[0])
    scratch = proposer.scratch.scan
    imagined_bits(situation.belief, proposer.exact, gap, viewpoint, situation.cones, scratch, left)
    return candidates[chosen].bits - left[0]


@lean_kernel
def _keep_target(proposer, situation, decision, number):
    """Add the viewpoint that a robot under way is driving to, pulled within its reach, to the pool."""
    pool, here, experience = proposer.scratch.pool, situation.here, situation.experience
    at = pool.viewpoints[number]
    copy_viewpoint(decision.target, at)
    for axis in range(3):
        at[axis] = min(max(at[axis], 0.0), float(situation.belief.size[axis]))
    _pull_within(proposer, here, at)
    evaluate(proposer, situation, proposer.exact, number, number + 1)
    if experience.going:
        copy_viewpoint(experience.goal, pool.goals[number])
        pool.kinds[number] = _FAR


@lean_kernel
def _pull_within(proposer, here, at):
    """Pull a viewpoint within reach of where the robot is."""
    length = distance_apart(at, here)
    if length > proposer.reach:
        for axis in range(3):
            at[axis] = here[axis] + (at[axis] - here[axis]) * proposer.reach / length


@lean_kernel
def _write_candidates(proposer, here, candidates, count):
    """Write down the candidates, in grid units; those that there are not are the first one."""
    pool, taken = proposer.scratch.pool, proposer.scratch.taken
    for k in range(len(candidates)):
        number, candidate = taken[k if k < count else 0], candidates[k]
        _pull_within(proposer, here, pool.viewpoints[number])
        copy_viewpoint(pool.viewpoints[number], candidate.viewpoint)
        copy_viewpoint(pool.goals[number], candidate.goal)
        candidate.bits = pool.stop_bits[number]
        candidate.kind = pool.kinds[number] if k < count else _NONE
