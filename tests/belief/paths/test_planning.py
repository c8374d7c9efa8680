"""Shortest paths against SciPy's Dijkstra on an explicit graph, and by hand."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import dijkstra

from entropy_explore_env.belief.paths.lattice import KNOWN_RATIO, new_lattice
from entropy_explore_env.belief.paths.planning import ANY_GOAL, resume_search, search_paths, start_search
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.belief.paths.graphs import (
    KNOWN,
    PRIOR,
    UNKNOWN,
    all_costs,
    belief_costs,
    costs_to_all,
    field_costs,
    graph_of,
    known,
    plan,
    random_rates,
    shortest_path,
)
from tests.reference.scenes import SHAPES, drawn, flat_index, random_cover, seeds

SIZE = (7, 11, 5)
FLAT = (9, 6, 1)
SQRT2 = math.sqrt(2.0)


@drawn(30)
@given(st.sampled_from(SHAPES), seeds, st.sampled_from([0.0, 0.3, 1.0, 2.5]), st.integers(1, 4))
def test_costs_are_those_of_dijkstra(shape, seed, decades, count):
    rates = random_rates(shape, seed, decades)
    rng = np.random.default_rng(seed)
    free = np.flatnonzero(np.isfinite(rates))
    sources = rng.choice(free, min(count, len(free)), replace=False)
    graph = graph_of(rates)
    each = dijkstra(graph, indices=sources)
    found = all_costs(new_search(rates.size), new_lattice(shape), field_costs(rates), sources)
    np.testing.assert_allclose(found.ravel(), each.min(axis=0), rtol=1e-8)


@drawn(30)
@given(st.sampled_from(SHAPES), seeds, st.sampled_from([0.0, 0.3, 1.0, 2.5]))
def test_paths_to_a_goal_are_those_of_dijkstra_and_their_steps_sum_up(shape, seed, decades):
    rates = random_rates(shape, seed, decades)
    free = np.flatnonzero(np.isfinite(rates))
    start, goal = np.random.default_rng(seed).choice(free, 2).tolist()
    graph = graph_of(rates)
    expected = dijkstra(graph, indices=start)[goal]
    search, lattice, costs = new_search(rates.size), new_lattice(shape), field_costs(rates)
    cost, path = shortest_path(search, lattice, costs, start, goal)
    assert cost == pytest.approx(expected, rel=1e-8)
    if math.isinf(expected):
        assert len(path) == 0
        return
    assert (path[0], path[-1]) == (start, goal)
    assert path.dtype == np.int32
    steps = [graph[a, b] for a, b in itertools.pairwise(path.tolist())]
    assert all(step > 0.0 for step in steps)
    assert sum(steps) == pytest.approx(expected, rel=1e-8)


@drawn(25)
@given(
    seeds,
    st.sampled_from([SIZE, (9, 8, 6), (12, 9, 1)]),
    st.sampled_from([0.0, 0.5, 0.6, 1.0, 1.2, 1.6, 2.2]),
    st.sampled_from([1.0, 2.5]),
)
def test_a_body_goes_where_the_world_has_room_for_it(seed, shape, radius, unknown_cost):
    """Incremental checks of the footprint agree with `World.collision_mask`, for unknown voxels too."""
    rng = np.random.default_rng(seed)
    covered = random_cover(shape, 0.03, seed) > 0.5
    covered.ravel()[0] = False
    blocked = World(Grid(shape, 1.0), covered, "drawn").collision_mask(radius) > 0
    if blocked.all():
        return
    precision = np.where(rng.random(shape) < 0.4, UNKNOWN, KNOWN).astype(np.float32)
    rates = np.where(blocked, math.inf, np.where(precision == UNKNOWN, unknown_cost, 1.0))
    source = rng.choice(np.flatnonzero(~blocked))
    costs = belief_costs(covered.astype(np.float32), precision, PRIOR, unknown_cost)
    found = all_costs(new_search(covered.size), new_lattice(shape, radius), costs, [source])
    expected = dijkstra(graph_of(rates), indices=source)
    np.testing.assert_allclose(found.ravel(), expected, rtol=1e-8)


@drawn(25)
@given(seeds, st.integers(0, 4), st.sampled_from([0.0, 1.2]))
def test_planar_robots_stay_in_their_layer_and_ignore_the_floor(seed, layer, radius):
    covered = random_cover(SIZE, 0.03, seed) > 0.5
    tall = np.zeros((7, 11, 5 + 4), bool)
    tall[:, :, 2:-2] = covered  # room above and below: the boundary there does not count
    blocked = World(Grid(tall.shape, 1.0), tall, "drawn").collision_mask(radius)[:, :, 2:-2] > 0
    free = np.argwhere(~blocked[:, :, layer])
    if len(free) == 0:
        return
    source = np.ravel_multi_index((*free[seed % len(free)], layer), SIZE)
    found = all_costs(
        new_search(covered.size),
        new_lattice(SIZE, radius, layer),
        belief_costs(*known(covered), PRIOR),
        [source],
    )
    expected = dijkstra(graph_of(np.where(blocked, math.inf, 1.0), layer), indices=source)
    np.testing.assert_allclose(found.ravel(), expected, rtol=1e-8)
    assert np.isinf(np.delete(found, layer, axis=2)).all()


def test_a_wall_with_a_gap():
    """Wall x = 4 with a gap at y = 5, from (1, 0) to (7, 0): two diagonals may not cut the gap's corners."""
    covered = np.zeros(FLAT, bool)
    covered[4, :5] = True
    cost, path = plan(*known(covered), (1, 0, 0), (7, 0, 0))
    # To (3, 5): 2 diagonals and 3 straight; through to (5, 5): 2; and the same back.
    assert cost == pytest.approx(2 * (2 * SQRT2 + 3) + 2)
    assert [4, 5, 0] in path.tolist()
    steps = np.abs(np.diff(path, axis=0)).sum(axis=1)
    at = path.tolist().index([4, 5, 0])
    assert steps[at - 1] == steps[at] == 1


@pytest.mark.parametrize(
    ("unknown_cost", "cost", "through"),
    [(1.0, 8.0, True), (2.0, 8.0 + 3.0, True), (1.7, 8.0 + 3 * 0.7, True), (2.5, 6 + 4 * SQRT2, False)],
)
def test_unknown_space_is_gone_through_or_around(unknown_cost, cost, through):
    """Three unknown columns, x = 3 … 5, y < 4, on the straight path from (0, 3) to (8, 3)."""
    mean, precision = known(np.zeros(FLAT, bool))
    precision[3:6, :4] = UNKNOWN
    around = 8.0 - 2.0 + 2.0 * SQRT2  # one row up before x = 3, down after x = 5
    expected = min(8.0 + 3.0 * (unknown_cost - 1.0), around)
    found, path = plan(mean, precision, (0, 3, 0), (8, 3, 0), unknown_cost=unknown_cost)
    assert found == pytest.approx(expected)
    assert (precision[tuple(path.T)] == UNKNOWN).any() == (expected < around)


def test_known_is_what_brought_half_a_bit():
    mean, precision = known(np.zeros((3, 1, 1), bool))
    precision[1] = np.float32(KNOWN_RATIO * PRIOR * 1.001)
    assert plan(mean, precision, (0, 0, 0), (2, 0, 0), unknown_cost=9.0)[0] == 2.0
    precision[1] = np.float32(KNOWN_RATIO * PRIOR * 0.999)
    assert plan(mean, precision, (0, 0, 0), (2, 0, 0), unknown_cost=9.0)[0] == 10.0


def test_coverage_of_a_half_is_passable():
    mean, precision = known(np.zeros((3, 1, 1), bool))
    mean[1] = 0.5
    assert plan(mean, precision, (0, 0, 0), (2, 0, 0))[0] == 2.0
    mean[1] = np.nextafter(np.float32(0.5), np.float32(1.0))
    assert math.isinf(plan(mean, precision, (0, 0, 0), (2, 0, 0))[0])


def octile(shape, voxel):
    """Costs in free 2-D space."""
    x, y = np.abs(np.arange(shape[0]) - voxel[0])[:, None], np.abs(np.arange(shape[1]) - voxel[1])
    return (np.maximum(x, y) + (SQRT2 - 1.0) * np.minimum(x, y))[:, :, None]


def test_start_is_goal():
    mean, precision = known(np.zeros(SIZE, bool))
    cost, path = plan(mean, precision, (1, 2, 3), (1, 2, 3))
    assert cost == 0.0 and path.tolist() == [[1, 2, 3]]
    mean[1, 2, 3] = 1.0
    assert plan(mean, precision, (1, 2, 3), (1, 2, 3))[0] == 0.0


def test_a_start_inside_a_covered_voxel_may_be_left_and_not_entered_again():
    covered = np.zeros((5, 3, 1), bool)
    covered[2] = True
    cost, _ = plan(*known(covered), (2, 1, 0), (4, 1, 0))
    assert cost == 2.0
    costs, lattice = belief_costs(*known(covered), PRIOR), new_lattice((5, 3, 1))
    found = all_costs(new_search(15), lattice, costs, flat_index([(2, 1, 0), (0, 0, 0)], (5, 3, 1)))
    assert found[4, 1, 0] == 2.0 and np.isinf(found[2, 0, 0])
    behind, _ = plan(*known(covered), (0, 1, 0), (4, 1, 0))
    assert math.isinf(behind)


def test_a_body_that_touches_something_at_its_start_may_leave():
    """Radius 2.2, and a covered voxel beside the start: the path leads away from it, never into it."""
    covered = np.zeros((19, 11, 1), bool)
    covered[5, 5] = True
    start, goal = (6, 5, 0), (15, 5, 0)
    cost, path = plan(*known(covered), start, goal, radius=2.2)
    assert cost == pytest.approx(9.0)
    assert [5, 5, 0] not in path.tolist()
    # On the other side of it, around: the body's room begins where it touches nothing more.
    cost, path = plan(*known(covered), start, (2, 5, 0), radius=2.2)
    blocked = World(Grid(covered.shape, 1.0), covered, "by hand").collision_mask(2.2) > 0
    ball = [v for v in path.tolist() if blocked[tuple(v)]]
    assert all(math.dist(v, start) < 2.2 + 1.0 for v in ball) and not math.isinf(cost)


@pytest.mark.parametrize(("radius", "fits"), [(0.5, True), (1.4, True), (1.5, True), (1.6, False)])
def test_a_body_in_a_corridor(radius, fits):
    """A corridor three voxels wide: its middle is 1½ edges from either wall."""
    assert math.isinf(plan(*known(np.zeros((9, 3, 1), bool)), (2, 1, 0), (6, 1, 0), radius)[0]) != fits


def test_paths_above_the_largest_cost_are_not_found():
    belief = known(np.zeros(FLAT, bool))
    assert plan(*belief, (0, 0, 0), (8, 0, 0), max_cost=8.0)[0] == 8.0
    assert math.isinf(plan(*belief, (0, 0, 0), (8, 0, 0), max_cost=7.999)[0])
    found = all_costs(new_search(54), new_lattice(FLAT), belief_costs(*belief, PRIOR), [0], max_cost=3.0)
    expected = octile(FLAT, (0, 0, 0))
    np.testing.assert_allclose(found, np.where(expected <= 3.0, expected, math.inf))


@drawn(40)
@given(st.sampled_from(SHAPES), seeds, st.lists(st.floats(0.0, 40.0), min_size=1, max_size=4))
def test_a_resumed_search_finds_what_one_up_to_that_cost_finds(shape, seed, limits):
    rates, lattice = random_rates(shape, seed, 1.0), new_lattice(shape)
    sources = np.random.default_rng(seed).integers(0, rates.size, 2).astype(np.int32)
    costs, search = field_costs(rates), new_search(rates.size)
    start_search(search, lattice, costs, sources)
    found = np.empty(rates.size)
    for max_cost in (*sorted(limits), math.inf):
        resume_search(search, lattice, costs, max_cost)
        costs_to_all(search, found)
        expected = all_costs(new_search(rates.size), lattice, costs, sources, max_cost)
        within = found <= max_cost
        np.testing.assert_array_equal(np.where(within, found, math.inf), expected.ravel())


@drawn(20)
@given(st.sampled_from(SHAPES), st.lists(seeds, min_size=2, max_size=4))
def test_searches_do_not_disturb_later_ones(shape, several):
    search, lattice = new_search(math.prod(shape)), new_lattice(shape)
    for seed in several:
        rates = random_rates(shape, seed, 1.0)
        start, goal = np.random.default_rng(seed).integers(0, rates.size, 2).tolist()
        used = shortest_path(search, lattice, field_costs(rates), start, goal)
        fresh = shortest_path(new_search(rates.size), lattice, field_costs(rates), start, goal)
        assert used[0] == fresh[0]
        np.testing.assert_array_equal(used[1], fresh[1])


def test_marks_of_millions_of_searches_ago_do_not_count():
    rates, lattice = random_rates(SIZE, 3, 0.5), new_lattice(SIZE)
    search = new_search(rates.size)
    all_costs(search, lattice, field_costs(random_rates(SIZE, 4, 0.5)), [7])
    search.searches[0] = 2**23 - 1
    found = all_costs(search, lattice, field_costs(rates), [9])
    assert search.searches[0] == 1
    fresh = all_costs(new_search(rates.size), lattice, field_costs(rates), [9])
    np.testing.assert_array_equal(found, fresh)


def test_a_full_queue_drops_what_is_out_of_date():
    """Costs from 1 to 10⁴ fill the queue with entries of voxels that were reached cheaper since."""
    shape = (60, 41, 1)
    rates, lattice = random_rates(shape, 1, 2.0, walls=0.0), new_lattice(shape)
    roomy, tight = new_search(rates.size), new_search(rates.size)
    expected = all_costs(roomy, lattice, field_costs(rates), [5, 2000])
    used = int(roomy.queue.state["unused"][0])
    tight = tight._replace(queue=tight.queue._replace(blocks=tight.queue.blocks[: used - 3]))
    found = all_costs(tight, lattice, field_costs(rates), [5, 2000])
    np.testing.assert_array_equal(found, expected)


def test_a_search_leaves_the_memory_of_what_it_does_not_reach_alone():
    shape = (300, 200, 1)
    search, costs = new_search(60_000), belief_costs(*known(np.zeros(shape, bool)), PRIOR)
    search.cost[:] = -1.0
    sources = np.array(flat_index([(150, 100, 0)], shape), np.int32)
    search_paths(search, new_lattice(shape), costs, sources, ANY_GOAL, 5.0)
    assert 0 < np.count_nonzero(search.mark) <= 13 * 2 * 32  # classified 32 at a time
    assert np.count_nonzero(search.cost != -1.0) <= 11 * 11


@pytest.mark.parametrize("radius", [0.0, 1.5])
def test_given_costs_hold_for_bodies_of_any_size(radius):
    costs = np.full(FLAT, 2.0, np.float32)
    costs[4, :, 0] = math.inf
    costs[4, 3, 0] = 5.0
    ends = flat_index([(0, 3, 0), (8, 3, 0)], FLAT)
    cost, path = shortest_path(new_search(54), new_lattice(FLAT, radius), field_costs(costs), *ends)
    assert cost == pytest.approx(6 * 2.0 + 2 * 3.5)
    assert path.tolist() == flat_index([(i, 3, 0) for i in range(9)], FLAT)


@pytest.mark.parametrize(
    ("ask", "field"),
    [
        (lambda: new_lattice(SIZE, -0.1), "body_radius"),
        (lambda: new_lattice(SIZE, math.nan), "body_radius"),
        (lambda: new_lattice(SIZE, 0.0, 5), "layer"),
    ],
)
def test_what_is_refused(ask, field):
    with pytest.raises(SettingError) as raised:
        ask()
    assert raised.value.field == field
