"""Steps in a cell and the coverage functional against naive ones, and by hand."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.papers.bhattacharya.simulation.covering import CellFunctional, coverage_functional, neighbours
from entropy_explore_env.belief.paths.geodesic_cells import new_tessellation
from tests.baselines.strategies.test_territory import scene
from tests.reference.scenes import SHAPES, drawn, seeds


@given(st.sampled_from(SHAPES), seeds, st.booleans())
@drawn(30)
def test_the_functional_is_the_sum_over_the_cell(size, seed, by_length):
    _, density, sources, space = scene(size, seed, by_length)
    for number in range(len(sources)):
        own = space.cells == number
        functional, count = coverage_functional(space.cells, space.costs, density, number)
        assert count == np.count_nonzero(own)
        assert functional == pytest.approx((space.costs[own] ** 2 * density[own]).sum())


@given(st.sampled_from(SHAPES), seeds)
@drawn(30)
def test_neighbours_are_those_to_which_no_step_cuts_a_corner(size, seed):
    """A diagonal step is free if all the steps along its axes, in any order, are."""
    free = np.random.default_rng(seed).random(size) < 0.7
    for here in range(0, free.size, 5):
        found = neighbours(free, here)
        for there in range(free.size):
            steps = np.subtract(np.unravel_index(there, size), np.unravel_index(here, size))
            axes = [axis for axis in range(3) if steps[axis]]
            wanted = 0 < len(axes) and np.abs(steps).max() == 1
            for order in itertools.permutations(axes) if wanted else ():
                place = list(np.unravel_index(here, size))
                for axis in order:
                    place[axis] += steps[axis]
                    wanted &= bool(free[tuple(place)])
            assert (there in found) == wanted


def test_gradient_search_walks_to_the_middle_of_a_corridor():
    size = (9, 1, 1)
    rates, space = np.ones(size, np.float32), new_tessellation(size)
    density, cell = np.ones(size, np.float32), np.ones(size, bool)
    functional, place, path = CellFunctional(space, rates, density, cell, (0.0, True)), 1, [1]
    assert functional.value(1) == 1 + sum(k * k for k in range(8))
    while (step := functional.step(place)) != place:
        place = step
        path.append(step)
    assert path == [1, 2, 3, 4]


def test_a_place_from_which_the_cell_cannot_be_reached_whole_is_worth_nothing():
    size = (5, 1, 1)
    rates, cell = np.ones(size, np.float32), np.array([1, 1, 0, 1, 1], bool).reshape(size)
    density = np.ones(size, np.float32)
    functional = CellFunctional(new_tessellation(size), rates, density, cell, (0.0, True))
    assert functional.value(0) == math.inf
