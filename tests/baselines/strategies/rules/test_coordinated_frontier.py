"""The rule `coordinated-frontier`: which robot goes where, by hand and beside the paper's algorithm."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.rules.coordinated_frontier import CoordinatedFrontier, greedy_worth
from entropy_explore_env.frontiers.blocks import NONE
from tests.planner.scenes import cell, corridor, mate, random_plan, scene_of, varied, with_mates
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds


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
