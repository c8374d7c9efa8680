"""Who goes where, by hand and beside the textbook's algorithm."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.rules.assigned_frontier import AssignedFrontier, groups
from baselines.strategies.rules.coordinated_frontier import CoordinatedFrontier, greedy_worth
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.missions.view import TeammateView
from tests.baselines.strategies.explorers.scenes import cell, corridor, random_plan, scene_of, varied
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds


def pose_in(place):
    """(5,) in the middle of a cell."""
    return np.array([0.1 * (place[0] + 0.5), 0.1 * (place[1] + 0.5), 0.05, 0.0, 0.0])


def mate(place, target=None):
    """A teammate that was heard in a cell just now; under way to another, if that is given."""
    announced_s = -1.0 if target is None else 5.0
    viewpoint = pose_in(place if target is None else target)
    return TeammateView(4.0, pose_in(place), announced_s, viewpoint, 0.0, 0.0)


def with_mates(scene, mates):
    scene.view.time_s = 5.0
    scene.view.teammates = dict(enumerate(mates, start=1))
    return scene


@given(st.sampled_from([(17, 11), (31, 14)]), st.integers(0, 2), st.integers(0, 2), seeds)
@drawn(40)
def test_the_robot_takes_what_the_algorithm_of_the_paper_gives_it(shape, choosing, moving, seed):
    """Cell by cell; all mates are where a path leads: the robot knows where they can go."""
    rng = np.random.default_rng(seed)
    plan, robot = random_plan(shape, rng)
    reached = np.isfinite(reference.lengths_from(plan, robot))
    free, near = np.argwhere(plan == reference.FREE), np.argwhere(reached)
    others = [tuple(map(int, near[rng.integers(len(near))])) for _ in range(choosing)]
    targets = [tuple(map(int, free[rng.integers(len(free))])) for _ in range(moving)]
    mates = [mate(place) for place in others] + [mate(robot, target) for target in targets]
    scene = with_mates(scene_of(plan, robot, block=1), mates)
    reach = scene.cells.reach
    picked = varied(CoordinatedFrontier(), beta=2.0).pick(scene)
    known = plan.copy()
    known[(plan == reference.FREE) & ~reached] = reference.WALL  # what no path reaches is nobody's
    given_first, given_last = (
        reference.coordinated(known, [robot, *others], targets, 2.0, reach, last) for last in (False, True)
    )
    if not given_first:
        assert picked == NONE
    else:  # a teammate may take either of two cells that are worth the same
        ways = (given_first, given_last)
        assert any(worth[cell(plan, picked)] == pytest.approx(max(worth.values())) for worth in ways)


def test_a_robot_leaves_the_frontier_to_which_another_goes_by_hand():
    """A corridor with both ends open, the nearer one a teammate's target."""
    plan, robot = corridor(), (8, 1)
    near, far = (1, 1), (27, 1)
    assert cell(plan, CoordinatedFrontier().pick(with_mates(scene_of(plan, robot), []))) == near
    scene = with_mates(scene_of(plan, robot), [mate((4, 1), near)])
    assert cell(plan, varied(CoordinatedFrontier(), beta=0.5).pick(scene)) == far


def test_who_chooses_at_the_same_time_gets_the_frontier_that_is_nearer_to_it():
    plan = corridor()
    for robot, other, wanted in (((8, 1), (4, 1), (27, 1)), ((8, 1), (20, 1), (1, 1))):
        scene = with_mates(scene_of(plan, robot), [mate(other)])
        assert cell(plan, varied(CoordinatedFrontier(), beta=0.5).pick(scene)) == wanted


def test_the_first_robot_pays_for_what_those_before_it_take():
    """Two cells four apart, range 8; the second robot is nearer to the first cell, and gets it."""
    places = np.array([[0.5, 0.5, 0.5], [4.5, 0.5, 0.5]])
    costs = np.array([[0.2, 0.6], [0.1, 0.9]])
    worth = greedy_worth(places, np.ones(2), costs, 8.0)
    assert worth == pytest.approx([1.0 - 1.0 - 0.2, 1.0 - 0.5 - 0.6])


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
