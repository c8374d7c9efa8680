"""Lengths in a layer by canonical paths: beside the general search, and by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.paths.layer_lengths import fill_layer_lengths
from entropy_explore_env.belief.paths.search import cost_to, new_search
from tests.belief.paths.graphs import all_costs, field_costs
from tests.reference.scenes import drawn, seeds

SQRT2 = math.sqrt(2.0)
LAYERS = [((9, 6, 1), 0), ((23, 31, 1), 0), ((1, 17, 1), 0), ((12, 2, 1), 0), ((13, 8, 3), 1)]
"""Shapes, and the layer that is searched."""
PLANS = st.tuples(st.tuples(st.integers(1, 70), st.integers(1, 70), st.just(1)), st.just(0))


def random_walls(shape, seed, share):
    """(X, Y, Z) 1 or inf; walls of single voxels, and of bars across the layer with gaps."""
    rng = np.random.default_rng(seed)
    field = np.where(rng.random(shape) < share, math.inf, 1.0).astype(np.float32)
    for _ in range(rng.integers(0, 4)):
        x, gap = rng.integers(shape[0]), rng.integers(shape[1])
        field[x] = math.inf
        field[x, gap] = 1.0
    return field


def lengths_of(field, layer, source, targets, search=None):
    """Lengths from a voxel to some, by canonical paths."""
    lengths = np.empty(len(targets))
    fill_layer_lengths(
        search or new_search(field.size),
        new_lattice(field.shape, layer=layer),
        field_costs(field),
        int(source),
        np.array(targets, np.int32),
        lengths,
    )
    return lengths


def in_layer(shape, layer):
    """Numbers of the voxels of a layer."""
    return np.arange(math.prod(shape)).reshape(shape)[:, :, layer].ravel()


@drawn(80)
@given(st.one_of(PLANS, st.sampled_from(LAYERS)), seeds, st.sampled_from([0.0, 0.02, 0.1, 0.3]))
def test_lengths_are_those_of_the_general_search_to_the_last_bit(place, seed, share):
    """Which is tested beside Dijkstra's."""
    shape, layer = place
    field, voxels = random_walls(shape, seed, share), in_layer(shape, layer)
    source = int(np.random.default_rng(seed).choice(voxels))
    lattice = new_lattice(shape, layer=layer)
    expected = all_costs(new_search(field.size), lattice, field_costs(field), [source]).ravel()
    np.testing.assert_array_equal(lengths_of(field, layer, source, voxels), expected[voxels])


@drawn(40)
@given(seeds, st.integers(1, 5))
def test_a_search_that_ends_at_its_targets_knows_their_lengths(seed, count):
    shape = (40, 31, 1)
    field, rng = random_walls(shape, seed, 0.15), np.random.default_rng(seed)
    source, targets = int(rng.integers(field.size)), rng.integers(0, field.size, count)
    whole = lengths_of(field, 0, source, np.arange(field.size))
    np.testing.assert_array_equal(lengths_of(field, 0, source, targets), whole[targets])


def test_a_path_through_two_doors_by_hand():
    """Walls at x = 2 and 5, doors at y = 0 and 4, from (0, 2): no step cuts a corner of a door."""
    field = np.ones((8, 5, 1), np.float32)
    field[2, 1:], field[5, :4] = math.inf, math.inf
    goals = [np.ravel_multi_index(at, field.shape) for at in ((3, 0, 0), (4, 4, 0), (6, 4, 0), (2, 3, 0))]
    source = np.ravel_multi_index((0, 2, 0), field.shape)
    to_door = SQRT2 + 1.0 + 2.0
    found = lengths_of(field, 0, source, goals)
    assert found == pytest.approx([to_door, to_door + SQRT2 + 3.0, to_door + SQRT2 + 5.0, math.inf])


def test_paths_longer_than_the_ring_of_buckets_are_the_shortest():
    """A hall that a path may leave early, by a door after 1,300 voxels, or late, by one after 2,900."""
    field, every = np.ones((4, 3000, 1), np.float32), np.arange(4 * 3000)
    field[1] = math.inf
    field[1, [1300, 2900]] = 1.0
    field[3, ::7] = math.inf
    expected = all_costs(new_search(field.size), new_lattice(field.shape), field_costs(field), [0])
    np.testing.assert_array_equal(lengths_of(field, 0, 0, every), expected.ravel())
    np.testing.assert_array_equal(lengths_of(field, 0, 0, [2 * 3000]), expected.ravel()[[2 * 3000]])


def test_a_body_may_start_where_nothing_passes():
    field = np.ones((4, 3, 1), np.float32)
    field[0, 0] = math.inf
    assert lengths_of(field, 0, 0, [0, 2, 11]) == pytest.approx([0.0, 2.0, SQRT2 * 2.0 + 1.0])


@drawn(20)
@given(st.lists(seeds, min_size=2, max_size=4))
def test_searches_do_not_disturb_later_ones_of_either_kind(several):
    shape = (23, 17, 1)
    search, lattice, every = new_search(23 * 17), new_lattice(shape), np.arange(23 * 17)
    for seed in several:
        field = random_walls(shape, seed, 0.2)
        source = int(np.random.default_rng(seed).integers(field.size))
        found = lengths_of(field, 0, source, every, search)
        assert all(math.isinf(cost_to(search, voxel)) for voxel in every)
        np.testing.assert_array_equal(all_costs(search, lattice, field_costs(field), [source]).ravel(), found)
        np.testing.assert_array_equal(lengths_of(field, 0, source, every), found)


def test_marks_of_millions_of_searches_ago_do_not_count():
    shape = (23, 17, 1)
    search, field, every = new_search(23 * 17), random_walls(shape, 1, 0.2), np.arange(23 * 17)
    lengths_of(random_walls(shape, 2, 0.2), 0, 5, every, search)
    search.searches[0] = 2**23 - 1
    np.testing.assert_array_equal(lengths_of(field, 0, 7, every, search), lengths_of(field, 0, 7, every))


def test_a_full_queue_drops_what_is_out_of_date():
    shape = (90, 80, 1)
    field, every = random_walls(shape, 4, 0.25), np.arange(90 * 80)
    roomy, tight = new_search(field.size), new_search(field.size)
    expected = lengths_of(field, 0, 4000, every, roomy)
    used = int(roomy.queue.state["unused"][0])
    tight = tight._replace(queue=tight.queue._replace(blocks=tight.queue.blocks[: used - 3]))
    np.testing.assert_array_equal(lengths_of(field, 0, 4000, every, tight), expected)
