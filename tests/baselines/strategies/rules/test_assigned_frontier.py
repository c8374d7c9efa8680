"""The rule `assigned-frontier`: which robot goes where, by hand and beside all assignments."""

from __future__ import annotations

import itertools
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.rules.assigned_frontier import AssignedFrontier, groups
from entropy_explore_env.frontiers.blocks import NONE
from tests.planner.scenes import cell, corridor, mate, random_plan, scene_of, varied, with_mates
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds


@given(st.sampled_from([(13, 9), (17, 7)]), st.integers(0, 2), st.sampled_from([3.0, 6.0]), seeds)
@drawn(40)
def test_the_assignment_is_one_of_those_with_the_least_sum(shape, others, radius, seed):
    """Beside all assignments; all mates are where a path leads."""
    rng = np.random.default_rng(seed)
    plan, robot = random_plan(shape, rng)
    near = np.argwhere(np.isfinite(reference.lengths_from(plan, robot)))
    places = [tuple(map(int, near[rng.integers(len(near))])) for _ in range(others)]
    scene = with_mates(scene_of(plan, robot, block=1), [mate(place) for place in places])
    picked = varied(AssignedFrontier(), radius=radius / scene.cells.reach).pick(scene)
    allowed = reference.assigned(plan, [robot, *places], radius)
    assert (picked == NONE) if not allowed else cell(plan, picked) in allowed


def test_the_assignment_has_the_least_sum_by_hand():
    """Both robots are nearer to the left end; the least sum sends the right one to the right end."""
    plan = corridor()
    left, right = (3, 1), (9, 1)
    small = varied(AssignedFrontier(), radius=0.05)
    alone = small.pick(with_mates(scene_of(plan, right), []))
    together = small.pick(with_mates(scene_of(plan, right), [mate(left)]))
    assert cell(plan, alone) == (1, 1) and cell(plan, together) == (27, 1)
    other = small.pick(with_mates(scene_of(plan, left), [mate(right)]))
    assert cell(plan, other) == (1, 1)


def test_more_robots_than_frontiers_go_to_the_nearest():
    plan = corridor()
    plan[28:, 1] = reference.WALL
    scene = with_mates(scene_of(plan, (20, 1)), [mate((4, 1)), mate((6, 1))])
    assert cell(plan, AssignedFrontier().pick(scene)) == (1, 1)


@given(st.integers(1, 30), seeds)
@drawn(30)
def test_groups_hold_every_place_within_the_radius_of_their_first(count, seed):
    places = np.random.default_rng(seed).random((count, 3)) * 10.0
    group = groups(places, 2.5)
    firsts = [int(np.flatnonzero(group == number)[0]) for number in range(group.max() + 1)]
    assert (group >= 0).all()
    assert all(math.dist(places[k], places[firsts[group[k]]]) <= 2.5 for k in range(count))
    assert all(math.dist(places[a], places[b]) > 2.5 for a, b in itertools.combinations(firsts, 2))
