"""Open tours beside all tours of a few places, and moves by hand."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.frontiers.open_tours import (
    insert_cheapest,
    move_stretches,
    open_tour,
    reverse_stretches,
    tour_length,
)
from tests.reference.scenes import drawn, seeds


def between(places):
    return np.linalg.norm(places[:, None] - places[None], axis=-1)


def shortest(lengths):
    """Of all orders, by trying them."""
    others = range(1, len(lengths))
    return min(tour_length(lengths, np.array([0, *order])) for order in itertools.permutations(others))


@given(st.integers(1, 7), seeds)
@drawn(60)
def test_tours_visit_all_places_once_and_are_nearly_the_shortest(count, seed):
    lengths = between(np.random.default_rng(seed).random((count, 2)))
    tour = open_tour(lengths)
    assert tour[0] == 0 and sorted(tour) == list(range(count))
    assert tour_length(lengths, tour) <= 1.15 * shortest(lengths) + 1e-9


def test_most_tours_are_the_shortest():
    rng, exact = np.random.default_rng(3), 0
    for _ in range(50):
        lengths = between(rng.random((7, 2)))
        exact += tour_length(lengths, open_tour(lengths)) <= shortest(lengths) + 1e-9
    assert exact >= 40


@given(st.integers(2, 30), seeds)
@drawn(30)
def test_no_move_shortens_a_finished_tour(count, seed):
    lengths = between(np.random.default_rng(seed).random((count, 2)))
    tour = open_tour(lengths)
    again = tour.copy()
    assert not reverse_stretches(lengths, again)
    assert not move_stretches(lengths, again, np.empty(count, np.int64))
    np.testing.assert_array_equal(again, tour)


def test_moves_by_hand():
    """Places on a line: a crossing is reversed, and one that was left out is put back in."""
    lengths = between(np.array([[0.0], [1.0], [2.0], [3.0], [4.0]]))
    crossed = np.array([0, 3, 2, 1, 4])
    assert reverse_stretches(lengths, crossed) and crossed.tolist() == [0, 1, 2, 3, 4]
    left_out = np.array([0, 2, 3, 1, 4])
    assert move_stretches(lengths, left_out, np.empty(5, np.int64))
    assert left_out.tolist() == [0, 1, 2, 3, 4]
    built = np.zeros(5, np.int64)
    insert_cheapest(lengths, built)
    assert built.tolist() == [0, 1, 2, 3, 4]
