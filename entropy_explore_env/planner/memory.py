"""What a robot remembers of its decisions, and how far it trusts what it expects."""

from __future__ import annotations

import math

from entropy_explore_env.belief.raycast import distance_between
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.states import PlannerState, next_state
from entropy_explore_env.planner.thresholds import (
    CLEARANCE,
    DEPLETED_FAILED_SHARE,
    DEPLETED_SCANS,
    DRIVE_TOLERANCE,
    FAILED_GAZES,
    FAILED_SHARE,
    FORGET_DISTANCE,
    KEEP_CLEAR_DECISIONS,
    LEAST_WORTH,
    LOW_GAIN,
    REMEMBERED,
    REMEMBERED_EDGES,
    SAME_GAZE_RAD,
    SAME_PLACE,
)
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.robots.pose_covariance import turn_between

_NONE, _FAR, _EXPLORING = int(Kind.NONE), int(Kind.FAR), int(PlannerState.EXPLORING)
_TEAMMATE, _EDGE = MoveEnd.TEAMMATE.code, MoveEnd.EDGE.code
_ARRIVED, _CORNERS = MoveEnd.ARRIVED.code, MoveEnd.CORNERS.code
_CHOSEN, _CHOSEN_RAD = 2e-3, 2e-3
"""A viewpoint that was chosen is the candidate that differs by less: actions may be float32."""


@lean_kernel
def copy_numbers(source, target):
    """Copy as many numbers as `target` has."""
    for i in range(len(target)):
        target[i] = source[i]


@lean_kernel
def chosen_number(candidates, target):
    """Return the number of the candidate, in grid units, that a robot chose last; -1 = something else."""
    for number in range(len(candidates)):
        at = candidates[number].viewpoint
        if (
            candidates[number].kind != _NONE
            and distance_between(at, target) < _CHOSEN
            and turn_between(target[3], at[3]) < _CHOSEN_RAD
            and abs(at[4] - target[4]) < _CHOSEN_RAD
        ):
            return number
    return -1


@lean_kernel
def learn(experience, candidates, knowledge, number, came_bits, body_radius):
    """Compare what came with what was expected, and remember what is not worth another try.

    Args:
        experience: EXPERIENCE, changed in place.
        candidates: (K,) CANDIDATE among which the robot chose.
        knowledge: KNOWLEDGE.
        number: Number of the candidate that it chose; -1 = something else.
        came_bits: Bits of its latest scan that count.
        body_radius: Radius of the robot.
    """
    here, target = knowledge.pose, knowledge.target
    if number >= 0 or not knowledge.under_way:  # a robot under way to what is out of reach keeps its goal
        experience.going = False
    if number >= 0 and candidates[number].kind == _FAR:
        experience.going = True
        copy_numbers(candidates[number].goal, experience.goal)
    if knowledge.under_way:
        return
    _forget(experience, here)
    experience.blocked = max(experience.blocked - 1, 0)
    if knowledge.move_end == _TEAMMATE:
        experience.blocked = KEEP_CLEAR_DECISIONS
    if knowledge.move_end == _EDGE:
        _remember_edge(experience, here, target, body_radius)
    missed = distance_between(target, here)
    expected = candidates[number].bits if number >= 0 else 0.0
    came = max(came_bits, 0.0)
    _count_low_gains(experience, here, expected)
    arrived = knowledge.move_end == _ARRIVED or knowledge.move_end == _CORNERS
    uncertain = knowledge.place_variance > 0.0 or knowledge.yaw_variance > 0.0
    depleted = experience.low_gain_scans >= DEPLETED_SCANS
    if missed > DRIVE_TOLERANCE and not (arrived and uncertain):
        _remember(experience, target, 0.0, max(2.0 * missed, FORGET_DISTANCE))
        experience.going = False
    elif came < (DEPLETED_FAILED_SHARE if depleted else FAILED_SHARE) * expected:
        _remember(experience, target, came / expected, FORGET_DISTANCE)


@lean_kernel
def _count_low_gains(experience, here, expected):
    """Count scans of low gain in a row from one place; once the planner is depleted, from any place."""
    moved = distance_between(experience.stood_at, here) >= SAME_PLACE
    if moved:
        copy_numbers(here, experience.stood_at)
    low = expected < LOW_GAIN * experience.most_bits
    if not low or (moved and experience.low_gain_scans < DEPLETED_SCANS):
        experience.low_gain_scans = 0
    if low:
        experience.low_gain_scans += 1


@lean_kernel
def weigh_time(recipe, experience, knowledge):
    """Set how much time weighs in bits / s^c at this decision, and return the PlannerState after the scan."""
    came = knowledge.gained_bits - experience.decided_bits
    seconds = max(knowledge.time_s - experience.decided_s, 1e-9)
    mean_rate = knowledge.gained_bits / max(knowledge.time_s, 1e-9)
    leaves = not knowledge.under_way and came / seconds < recipe.leave_below * mean_rate
    state = next_state(experience.low_gain_scans, leaves, math.inf, False)
    if knowledge.under_way:
        return state
    exponent = recipe.exponent if state == _EXPLORING else min(recipe.exponent, 1.0)
    experience.looked_far &= exponent == experience.exponent
    experience.exponent = exponent
    experience.decided_s, experience.decided_bits = knowledge.time_s, knowledge.gained_bits
    return state


@lean_kernel
def value_of(proposer, situation, bits, seconds):
    """Return bits / s^c, with the least time that counts; 0 where there is no path."""
    if seconds == math.inf:
        return 0.0
    return bits / max(seconds, proposer.least_s) ** situation.experience.exponent


@lean_kernel
def _forget(experience, here):
    """Forget the failures that lie far behind: as if all of the expected bits had come."""
    for number in range(min(experience.failures, REMEMBERED)):
        if distance_between(experience.failed[number], here) >= experience.forget_at[number]:
            experience.share[number] = 1.0


@lean_kernel
def _remember(experience, viewpoint, share, forget_at):
    """Remember a failure, in place of the oldest one where there is no room."""
    number = experience.failures % REMEMBERED
    copy_numbers(viewpoint, experience.failed[number])
    experience.share[number], experience.forget_at[number] = share, forget_at
    experience.failures += 1


@lean_kernel
def _remember_edge(experience, here, target, body_radius):
    """Remember the first place on the way to a target at which the ground does not carry a robot."""
    length = distance_between(here, target)
    if length == 0.0:
        return
    at = experience.edge_at[experience.edges % REMEMBERED_EDGES]
    for axis in range(3):
        at[axis] = here[axis] + (body_radius + 1.0) * (target[axis] - here[axis]) / length
    experience.edges += 1


@lean_kernel
def trust_in(experience, all_around, at):
    """Return the share of the expected bits that viewpoints like this one brought; 1 without a failure there.

    Where many gazes of one place failed, wider and wider ones around each count as alike: what hides from a
    robot what it expects to see, as a teammate's body does, hides it from every gaze that way.
    """
    trust, here, count = 1.0, 0, min(experience.failures, REMEMBERED)
    for number in range(count):
        there = distance_between(experience.failed[number], at) < SAME_PLACE
        here += int(there and experience.share[number] < 1.0)
    alike_rad = SAME_GAZE_RAD * (1 + max(here - FAILED_GAZES, 0))
    for number in range(count):
        failed, share = experience.failed[number], experience.share[number]
        if distance_between(failed, at) >= SAME_PLACE:
            continue
        if share > 0.0 and not all_around:
            if turn_between(at[3], failed[3]) >= alike_rad or abs(failed[4] - at[4]) >= alike_rad:
                continue
        trust *= share
    return trust


@lean_kernel
def worth_bits(proposer, situation, at, bits):
    """Return what expected bits at a viewpoint (5,) are worth to a robot with its experience."""
    share = proposer.recipe.known_ground_share
    if share > 0.0:
        bits = max(bits - share * situation.experience.most_bits, LEAST_WORTH * bits)
    return bits * trust_and_clearance(proposer, situation, at)


@lean_kernel
def trust_and_clearance(proposer, situation, at):
    """Return the share of the expected bits that like viewpoints brought; 0 where something is in the way.

    That is a teammate, or a place where the ground ended under the robot before: a map does not show it.
    Whether a place is worth driving to at all is asked of this share, not of `worth_bits`.
    """
    experience, here = situation.experience, situation.knowledge.pose
    if experience.blocked > 0:
        for mate in situation.mates:
            clear = CLEARANCE * (mate.body_radius + proposer.drive.body_radius)
            if mate.body_radius > 0.0 and _comes_near(here, at, mate.place, clear):
                return 0.0
    clear = proposer.drive.body_radius + 0.5
    for number in range(min(experience.edges, REMEMBERED_EDGES)):
        if _comes_near(here, at, experience.edge_at[number], clear):
            return 0.0
    return trust_in(experience, proposer.all_around, at)


@lean_kernel
def _comes_near(here, there, body, clear):
    """Return whether a straight drive brings a robot nearer to a body than allowed.

    Where they touch already, only drives away from it are free.
    """
    length, along = 0.0, 0.0
    for axis in range(3):
        step = there[axis] - here[axis]
        length += step * step
        along += step * (body[axis] - here[axis])
    share = min(max(along / max(length, 1e-12), 0.0), 1.0)
    gap = 0.0
    for axis in range(3):
        gap += (here[axis] + share * (there[axis] - here[axis]) - body[axis]) ** 2
    return length > 1e-12 and math.sqrt(gap) < clear and share > 0.0
