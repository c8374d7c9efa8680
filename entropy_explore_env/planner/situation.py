"""What a robot's candidates depend on, and what it remembers of what did not come, in grid units."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import Costs
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.thresholds import (
    ALIKE_EDGES,
    ALIKE_RAD,
    BLOCKED_DECISIONS,
    CLEAR,
    DISAPPOINTING,
    DREGS_SHARE,
    EDGES,
    FAILED_GAZES,
    FORGET_EDGES,
    MISSED_EDGES,
    POOR,
    REMEMBERED,
    STALE,
    STALE_DISAPPOINTING,
)
from entropy_explore_env.robots.motion import MoveEnd

_NONE, _FAR = int(Kind.NONE), int(Kind.FAR)
_TEAMMATE, _EDGE = MoveEnd.TEAMMATE.code, MoveEnd.EDGE.code
_ARRIVED, _CORNERS = MoveEnd.ARRIVED.code, MoveEnd.CORNERS.code
_SAME_EDGES, _SAME_RAD = 2e-3, 2e-3
"""A viewpoint that was chosen is the candidate that differs by less: actions may be float32."""


class Situation(NamedTuple):
    """What one robot's candidates depend on."""

    belief: Belief
    costs: Costs
    """Of traversal, by the belief."""
    here: np.ndarray
    """(5,) its pose, place in grid units."""
    cones: np.ndarray
    """(M,) CONE, which are left to teammates."""
    mates: np.ndarray
    """(M,) MATE, teammates that were heard."""
    experience: np.record
    """EXPERIENCE."""
    since_scan: float
    """Voxel edges that it has driven since its latest scan."""


class LastDecision(NamedTuple):
    """What a robot chose last, and what came of it."""

    target: np.ndarray
    """(5,) the viewpoint, grid units."""
    target_m: np.ndarray
    """(5,) the same in the map frame."""
    voxel_size_m: float
    came_bits: float
    """Bits that its latest scan took from its map."""
    move_end: int
    """Code of a MoveEnd."""
    under_way: bool
    """Whether it still drives there."""
    uncertain: bool
    """Whether its pose is an estimate: nothing cut a drive short that ended elsewhere, where it arrived."""
    time_s: float
    """Now."""
    gained_bits: float
    """Since the mission began, by its own scans."""


@lean_kernel
def turned(angle, other):
    """How far an angle is from another, 0 to π."""
    return abs((angle - other + math.pi) % (2.0 * math.pi) - math.pi)


@lean_kernel
def distance_apart(a, b):
    """Distance between two places, the first three numbers of each."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@lean_kernel
def chosen_number(candidates, decision):
    """Number of the candidate that a robot chose last; -1 = it chose something else."""
    for number in range(len(candidates)):
        at, target = candidates[number].viewpoint, decision.target_m
        if (
            candidates[number].kind != _NONE
            and distance_apart(at, target) < _SAME_EDGES * decision.voxel_size_m
            and turned(at[3], target[3]) < _SAME_RAD
            and abs(at[4] - target[4]) < _SAME_RAD
        ):
            return number
    return -1


@lean_kernel
def learn(experience, candidates, decision, number, came_bits, here, body_radius):
    """Compare what came with what was expected, and remember what is not worth another try.

    Args:
        experience: EXPERIENCE, changed in place.
        candidates: (K,) CANDIDATE among which it chose.
        decision: LastDecision.
        number: Of the candidate that it chose; -1 = something else.
        came_bits: Those of its latest scan that count.
        here: (5,) where the robot is, grid units.
        body_radius: Of the robot, voxel edges.
    """
    if number >= 0 or not decision.under_way:  # who is under way to what is out of reach keeps its goal
        experience.going = False
    if number >= 0 and candidates[number].kind == _FAR:
        experience.going = True
        for i in range(5):
            experience.goal[i] = candidates[number].goal[i]
    if decision.under_way:
        return
    _forget(experience, here)
    experience.blocked = max(experience.blocked - 1, 0)
    if decision.move_end == _TEAMMATE:
        experience.blocked = BLOCKED_DECISIONS
    if decision.move_end == _EDGE:
        _remember_edge(experience, here, decision.target, body_radius)
    missed = distance_apart(decision.target, here)
    expected = candidates[number].bits if number >= 0 else 0.0
    came = max(came_bits, 0.0)
    _count_poor(experience, here, expected)
    arrived = decision.move_end == _ARRIVED or decision.move_end == _CORNERS
    if missed > MISSED_EDGES and not (arrived and decision.uncertain):
        _remember(experience, decision.target, 0.0, max(2.0 * missed, FORGET_EDGES))
        experience.going = False
    elif came < (STALE_DISAPPOINTING if experience.poor_scans >= STALE else DISAPPOINTING) * expected:
        _remember(experience, decision.target, came / expected, FORGET_EDGES)


@lean_kernel
def _count_poor(experience, here, expected):
    """Count the poor scans that a robot takes in a row from one place; once they are many, from any place."""
    moved = distance_apart(experience.stood_at, here) >= ALIKE_EDGES
    if moved:
        for axis in range(3):
            experience.stood_at[axis] = here[axis]
    if expected >= POOR * experience.most_bits or (moved and experience.poor_scans < STALE):
        experience.poor_scans = 0
    if expected < POOR * experience.most_bits:
        experience.poor_scans += 1


@lean_kernel
def weigh_time(proposer, experience, decision):
    """Set how much time weighs in bits / s^c at this decision; see `Recipe.leave_below` and `STALE`.

    Args:
        proposer: A Proposer.
        experience: EXPERIENCE, changed in place.
        decision: LastDecision.
    """
    if decision.under_way:
        return
    exponent = proposer.recipe.exponent
    came, seconds = decision.gained_bits - experience.decided_bits, decision.time_s - experience.decided_s
    mean_rate = decision.gained_bits / max(decision.time_s, 1e-9)
    wanes = came / max(seconds, 1e-9) < proposer.recipe.leave_below * mean_rate
    if wanes or experience.poor_scans >= STALE:
        exponent = min(exponent, 1.0)
    experience.looked_far &= exponent == experience.exponent
    experience.exponent = exponent
    experience.decided_s, experience.decided_bits = decision.time_s, decision.gained_bits


@lean_kernel
def _forget(experience, here):
    """Forget the failures that lie far behind."""
    kept = 0
    for number in range(experience.failures):
        if distance_apart(experience.failed[number], here) < experience.forget_at[number]:
            _move(experience, number, kept)
            kept += 1
    experience.failures = kept


@lean_kernel
def _move(experience, source, target):
    """Write a failure in place of another."""
    for i in range(5):
        experience.failed[target, i] = experience.failed[source, i]
    experience.share[target] = experience.share[source]
    experience.forget_at[target] = experience.forget_at[source]


@lean_kernel
def _remember(experience, viewpoint, share, forget_at):
    """Remember a failure, in place of the oldest where there are too many."""
    if experience.failures == REMEMBERED:
        for number in range(REMEMBERED - 1):
            _move(experience, number + 1, number)
        experience.failures = REMEMBERED - 1
    number = experience.failures
    for i in range(5):
        experience.failed[number, i] = viewpoint[i]
    experience.share[number], experience.forget_at[number] = share, forget_at
    experience.failures = number + 1


@lean_kernel
def _remember_edge(experience, here, target, body_radius):
    """Remember the first place on the way to a target at which the ground does not carry a robot."""
    length = distance_apart(here, target)
    if length == 0.0:
        return
    at = experience.edge_at[experience.edges % EDGES]
    for axis in range(3):
        at[axis] = here[axis] + (body_radius + 1.0) * (target[axis] - here[axis]) / length
    experience.edges += 1


@lean_kernel
def trust_in(experience, all_around, at):
    """Share of the expected bits that viewpoints like this one brought; 1 where none was a failure.

    Where many gazes of one place failed, wider and wider ones around each count as alike: what hides from a
    robot what it expects to see, as a teammate's body does, hides it from every gaze that way.
    """
    trust, here = 1.0, 0
    for number in range(experience.failures):
        here += int(distance_apart(experience.failed[number], at) < ALIKE_EDGES)
    alike_rad = ALIKE_RAD * (1 + max(here - FAILED_GAZES, 0))
    for number in range(experience.failures):
        failed, share = experience.failed[number], experience.share[number]
        if distance_apart(failed, at) >= ALIKE_EDGES:
            continue
        if share > 0.0 and not all_around:
            if turned(failed[3], at[3]) >= alike_rad or abs(failed[4] - at[4]) >= alike_rad:
                continue
        trust *= share
    return trust


@lean_kernel
def worth_bits(proposer, situation, at, bits):
    """What expected bits at a viewpoint (5,) are worth to a robot that remembers what it has experienced."""
    experience = situation.experience
    if proposer.recipe.dregs > 0.0:
        bits = max(bits - proposer.recipe.dregs * experience.most_bits, DREGS_SHARE * bits)
    return bits * trust_and_clearance(proposer, situation, at)


@lean_kernel
def trust_and_clearance(proposer, situation, at):
    """Share of the expected bits that viewpoints like this one brought; 0 where something is in the way.

    That is a teammate, or a place where the ground ended under the robot before: a map does not show it.

    Whether a place is worth driving to at all is asked of this share, not of `worth_bits`: dregs are bits.
    """
    experience = situation.experience
    if experience.blocked > 0:
        for mate in situation.mates:
            clear = CLEAR * (mate.body_radius + proposer.drive.body_radius)
            if mate.body_radius > 0.0 and _comes_near(situation.here, at, mate.place, clear):
                return 0.0
    clear = proposer.drive.body_radius + 0.5
    for number in range(min(experience.edges, EDGES)):
        if _comes_near(situation.here, at, experience.edge_at[number], clear):
            return 0.0
    return trust_in(experience, proposer.all_around, at)


@lean_kernel
def _comes_near(here, there, body, clear):
    """Whether a straight drive brings a robot nearer to a body than allowed.

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
