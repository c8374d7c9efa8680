"""What a robot sends (Rocha04, eq. 43), and whether it arrives."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.robots.channel import (
    Air,
    Delivery,
    draw_delivery,
    edges_in_walls,
    path_loss_db,
    select_measurements,
    steered_i_min,
)
from tests.reference import rocha04
from tests.reference.scenes import drawn, ray_space, seeds


def select(utility, burst, i_min):
    order = np.full(len(utility), -7, np.int64)
    count = select_measurements(np.asarray(utility, np.float64), burst, float(i_min), order)
    assert (order[count:] == -7).all() or count == len(utility) or burst == 0
    return order[:count].tolist()


# Few different values, so that ties are common; -1 stands for a ray that measured nothing.
utilities = st.lists(
    st.one_of(st.sampled_from([-1.0, 0.0, 0.25, 0.3219, 0.5, 2.0]), st.floats(0.0, 5.0)), max_size=40
)


@drawn(200)
@given(utilities, st.integers(0, 45), st.sampled_from([0.0, 0.0291, 0.25, 0.3219, 0.6215, 3.0]))
def test_the_selection_fulfils_equation_43_and_is_that_of_the_reference(utility, burst, i_min):
    chosen = select(utility, burst, i_min)
    assert rocha04.is_valid_selection(utility, chosen, burst, i_min)
    assert chosen == rocha04.select(utility, burst, i_min)


@drawn(80)
@given(utilities, st.integers(1, 45), st.floats(1e-6, 5.0), st.floats(0.01, 1.0))
def test_i_min_is_steered_like_the_reference(utility, burst, i_min, fill):
    steered = steered_i_min(i_min, np.asarray(utility, np.float64), burst, fill)
    assert steered == pytest.approx(rocha04.steered(i_min, utility, burst, fill, 0.1), rel=1e-12)


def test_i_min_by_hand():
    utility = np.array([0.5, 2.0, 0.1, 2.0, -1.0])
    assert steered_i_min(0.4, utility, 3, 1.0) == 0.4  # three reach it: as it should be
    assert steered_i_min(1.0, utility, 4, 1.0) == pytest.approx(math.exp(-0.05))  # two of four
    assert steered_i_min(1.0, utility, 4, 0.25) == pytest.approx(math.exp(0.1))  # two, and one wanted
    assert steered_i_min(0.1, utility, 1, 1.0) == pytest.approx(0.1 * math.exp(0.1))  # four: no more
    assert steered_i_min(3.0, utility, 4, 0.25) == pytest.approx(3.0 * math.exp(-0.1))
    assert steered_i_min(1e-6, -np.ones(5), 4, 1.0) == 1e-6  # nothing measured: not below the least


def reached(distance, range_m, loss, rng=None):
    rng = np.array([1], np.uint64) if rng is None else rng
    return list(Delivery)[draw_delivery(distance, range_m, loss, rng)]


def test_a_message_reaches_as_far_as_the_channel():
    assert reached(5.0, math.inf, 0.0) is Delivery.HEARD
    assert reached(5.0, 5.0, 0.0) is Delivery.HEARD
    assert reached(5.0, 4.999, 0.0) is Delivery.OUT_OF_RANGE
    assert reached(0.0, 1e-9, 0.0) is Delivery.HEARD


def test_random_numbers_are_drawn_only_where_a_message_can_be_lost():
    rng = np.array([9], np.uint64)
    reached(1.0, 5.0, 0.0, rng)
    assert rng[0] == 9
    reached(1.0, 5.0, 0.5, rng)
    assert rng[0] != 9
    in_range, out_of_range = np.array([9], np.uint64), np.array([9], np.uint64)
    reached(1.0, 5.0, 0.5, in_range)
    assert reached(9.0, 5.0, 0.5, out_of_range) is Delivery.OUT_OF_RANGE
    assert in_range[0] == out_of_range[0]  # the next draws do not depend on where teammates are


@pytest.mark.parametrize("loss", [0.1, 0.5, 0.9, 1.0])
def test_messages_are_lost_as_often_as_asked(loss):
    rng = np.array([123], np.uint64)
    lost = sum(reached(1.0, 5.0, loss, rng) is Delivery.LOST for _ in range(4000))
    assert abs(lost / 4000 - loss) <= 4 * math.sqrt(loss * (1 - loss) / 4000)


def slow_walls(occupied, start, finish, samples=20_000):
    """Length of a straight line in solid voxels, in grid units: at the middles of many short pieces."""
    start, finish = np.asarray(start), np.asarray(finish)
    shares = (np.arange(samples) + 0.5) / samples
    voxels = np.floor(start + shares[:, None] * (finish - start)).astype(int)
    return np.linalg.norm(finish - start) * occupied[tuple(voxels.T)].mean()


def walls(occupied, start, finish):
    air = Air(occupied.ravel(), ray_space(occupied.shape, behind=1))
    return edges_in_walls(air, occupied.shape, tuple(map(float, start)), tuple(map(float, finish)))


@drawn(40)
@given(seeds)
def test_what_a_line_crosses_of_walls_is_what_the_slow_reference_finds(seed):
    rng = np.random.default_rng(seed)
    occupied = (rng.random((7, 11, 5)) < 0.3).astype(np.float32)
    start, finish = (rng.random(3) * (7, 11, 5) for _ in range(2))
    within = walls(occupied, start, finish)
    assert within == pytest.approx(slow_walls(occupied, start, finish), abs=0.02)
    assert walls(occupied, finish, start) == within


def test_walls_by_hand():
    """One wall, of one voxel, straight and aslant; a line along its face; and two places that are one."""
    occupied = np.zeros((7, 11, 5), np.float32)
    occupied[:, 4] = 1.0
    assert walls(occupied, (2.5, 1.5, 2.5), (2.5, 8.0, 2.5)) == pytest.approx(1.0)
    assert walls(occupied, (1.0, 2.5, 2.5), (5.0, 6.5, 2.5)) == pytest.approx(math.sqrt(2.0))
    assert walls(occupied, (2.5, 1.5, 2.5), (2.5, 4.0, 2.5)) == 0.0
    assert walls(occupied, (2.5, 3.9, 2.5), (2.5, 4.5, 2.5)) == pytest.approx(0.5)
    assert walls(occupied, (2.5, 1.5, 2.5), (2.5, 1.5, 2.5)) == 0.0


def test_path_loss_by_hand():
    """20 dB a decade in the open; 12 dB a metre of wall; no more than at a hundredth of a metre."""
    assert path_loss_db(10.0, 2.0, 30.0, 0.0) == pytest.approx(20.0)
    assert path_loss_db(100.0, 3.0, 12.0, 0.5) == pytest.approx(66.0)
    assert path_loss_db(1.0, 4.0, 12.0, 0.0) == 0.0
    assert path_loss_db(0.0, 2.0, 12.0, 0.0) == pytest.approx(-40.0)
