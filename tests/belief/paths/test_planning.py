"""Shortest ways against SciPy's Dijkstra on an explicit graph, and by hand."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from entropy_explore_env.belief.paths.lattice import KNOWN_RATIO, belief_costs, new_lattice, rate_costs
from entropy_explore_env.belief.paths.planning import (
    UNREACHED,
    begin_search,
    geodesics,
    search_ways,
    shortest_way,
    widen_search,
)
from entropy_explore_env.belief.paths.search import collect, new_search
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings import Grid
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import SHAPES, drawn, flat_index, random_cover, seeds

SIZE = (7, 11, 5)
FLAT = (9, 6, 1)
PRIOR = 1.0 / 900.0
KNOWN, UNKNOWN = 100.0, PRIOR
NO_CELLS = np.zeros(0, np.int32)
SQRT2, SQRT3 = math.sqrt(2.0), math.sqrt(3.0)


def graph_of(rates, layer=None):
    """Steps between neighbours, (V, V) sparse: none past a corner that is impassable."""
    shape, edges = rates.shape, {}
    for voxel in np.ndindex(*shape):
        for step in itertools.product((-1, 0, 1), repeat=3):
            near = tuple(np.add(voxel, step).tolist())
            if not any(step) or not all(0 <= n < size for n, size in zip(near, shape, strict=True)):
                continue
            if layer is not None and (voxel[2] != layer or step[2] != 0):
                continue
            passed = itertools.product(*({0, axis} for axis in step))
            if all(math.isfinite(rates[tuple(np.add(voxel, part).tolist())]) for part in passed):
                rate = 0.5 * (float(rates[voxel]) + float(rates[near]))
                edges[np.ravel_multi_index(voxel, shape), np.ravel_multi_index(near, shape)] = (
                    math.dist(voxel, near) * rate
                )
    rows, columns = zip(*edges, strict=True) if edges else ((), ())
    return csr_matrix((list(edges.values()), (rows, columns)), shape=(rates.size, rates.size))


def random_rates(shape, seed, decades, walls=0.25):
    rng = np.random.default_rng(seed)
    rates = (10.0 ** rng.uniform(-decades, decades, shape)).astype(np.float32)
    rates[rng.random(shape) < walls] = math.inf
    rates.ravel()[rng.integers(rates.size)] = 1.0
    return rates


def known(covered):
    """Mean and precision of a belief that is sure of everything."""
    return covered.astype(np.float32), np.full(covered.shape, KNOWN, np.float32)


def plan(mean, precision, start, goal, radius=0.0, layer=None, unknown_cost=1.0, reach=math.inf):
    """Cost and voxels (N, 3) of a way through a belief."""
    costs = belief_costs(mean, precision, PRIOR, unknown_cost)
    lattice = new_lattice(mean.shape, radius, layer)
    ends = flat_index([start, goal], mean.shape)
    cost, way = shortest_way(new_search(mean.size), lattice, costs, *ends, reach)
    return cost, np.stack(np.unravel_index(way, mean.shape), axis=-1)


@drawn(60)
@given(st.sampled_from(SHAPES), seeds, st.sampled_from([0.0, 0.3, 1.0, 2.5]), st.integers(1, 4))
def test_costs_and_cells_are_those_of_dijkstra(shape, seed, decades, count):
    rates = random_rates(shape, seed, decades)
    rng = np.random.default_rng(seed)
    free = np.flatnonzero(np.isfinite(rates))
    sources = rng.choice(free, min(count, len(free)), replace=False)
    graph = graph_of(rates)
    each = dijkstra(graph, indices=sources)
    found = geodesics(new_search(rates.size), new_lattice(shape), rate_costs(rates), sources)
    np.testing.assert_allclose(found.cost.ravel(), each.min(axis=0), rtol=1e-8)
    nearest = each <= each.min(axis=0) * (1.0 + 1e-9)
    reached = np.isfinite(each.min(axis=0))
    expected = np.where(reached, nearest.argmax(axis=0), UNREACHED)  # the first of equals
    np.testing.assert_array_equal(found.cell.ravel(), expected)


@drawn(60)
@given(st.sampled_from(SHAPES), seeds, st.sampled_from([0.0, 0.3, 1.0, 2.5]))
def test_ways_to_a_goal_are_those_of_dijkstra_and_their_steps_sum_up(shape, seed, decades):
    rates = random_rates(shape, seed, decades)
    free = np.flatnonzero(np.isfinite(rates))
    start, goal = np.random.default_rng(seed).choice(free, 2).tolist()
    graph = graph_of(rates)
    expected = dijkstra(graph, indices=start)[goal]
    search, lattice, costs = new_search(rates.size), new_lattice(shape), rate_costs(rates)
    cost, way = shortest_way(search, lattice, costs, start, goal)
    assert cost == pytest.approx(expected, rel=1e-8)
    if math.isinf(expected):
        assert len(way) == 0
        return
    assert (way[0], way[-1]) == (start, goal)
    assert way.dtype == np.int32
    steps = [graph[a, b] for a, b in itertools.pairwise(way.tolist())]
    assert all(step > 0.0 for step in steps)
    assert sum(steps) == pytest.approx(expected, rel=1e-8)


@drawn(40)
@given(
    seeds,
    st.sampled_from([SIZE, (9, 8, 6), (12, 9, 1)]),
    st.sampled_from([0.0, 0.5, 0.6, 1.0, 1.2, 1.6, 2.2]),
    st.sampled_from([1.0, 2.5]),
)
def test_a_body_goes_where_the_world_has_room_for_it(seed, shape, radius, unknown_cost):
    """Incremental looks at the body's ball agree with `World.collision_mask`, for unknown voxels too."""
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
    found = geodesics(new_search(covered.size), new_lattice(shape, radius), costs, [source])
    expected = dijkstra(graph_of(rates), indices=source)
    np.testing.assert_allclose(found.cost.ravel(), expected, rtol=1e-8)


@drawn(25)
@given(seeds, st.integers(0, 4), st.sampled_from([0.0, 1.2]))
def test_planar_robots_stay_in_their_layer_and_know_no_floor(seed, layer, radius):
    covered = random_cover(SIZE, 0.03, seed) > 0.5
    tall = np.zeros((7, 11, 5 + 4), bool)
    tall[:, :, 2:-2] = covered  # room above and below: the boundary there does not count
    blocked = World(Grid(tall.shape, 1.0), tall, "drawn").collision_mask(radius)[:, :, 2:-2] > 0
    free = np.argwhere(~blocked[:, :, layer])
    if len(free) == 0:
        return
    source = np.ravel_multi_index((*free[seed % len(free)], layer), SIZE)
    found = geodesics(
        new_search(covered.size),
        new_lattice(SIZE, radius, layer),
        belief_costs(*known(covered), PRIOR),
        [source],
    )
    expected = dijkstra(graph_of(np.where(blocked, math.inf, 1.0), layer), indices=source)
    np.testing.assert_allclose(found.cost.ravel(), expected, rtol=1e-8)
    assert np.isinf(np.delete(found.cost, layer, axis=2)).all()


def test_a_wall_with_a_gap():
    """Wall x = 4 with a gap at y = 5, from (1, 0) to (7, 0): two diagonals may not cut the gap's corners."""
    covered = np.zeros(FLAT, bool)
    covered[4, :5] = True
    cost, way = plan(*known(covered), (1, 0, 0), (7, 0, 0))
    # To (3, 5): 2 diagonals and 3 straight; through to (5, 5): 2; and the same back.
    assert cost == pytest.approx(2 * (2 * SQRT2 + 3) + 2)
    assert [4, 5, 0] in way.tolist()
    steps = np.abs(np.diff(way, axis=0)).sum(axis=1)
    at = way.tolist().index([4, 5, 0])
    assert steps[at - 1] == steps[at] == 1


def test_nobody_squeezes_between_two_corners():
    covered = np.zeros((3, 4, 1), bool)
    covered[1, :3] = True
    assert plan(*known(covered), (0, 2, 0), (2, 2, 0))[0] == pytest.approx(4.0)
    covered[1, 3] = True
    covered[1, 0] = False
    assert plan(*known(covered), (0, 1, 0), (2, 1, 0))[0] == pytest.approx(4.0)
    diagonal = np.zeros((2, 3, 1), bool)
    diagonal[0, 1] = diagonal[1, 0] = True
    assert plan(*known(diagonal), (0, 0, 0), (1, 1, 0)) == (math.inf, pytest.approx(np.zeros((0, 3))))


@pytest.mark.parametrize("solid", [(0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0)])
def test_a_space_diagonal_passes_six_voxels(solid):
    covered = np.zeros((2, 2, 2), bool)
    assert plan(*known(covered), (0, 0, 0), (1, 1, 1))[0] == pytest.approx(SQRT3)
    covered[solid] = True
    assert plan(*known(covered), (0, 0, 0), (1, 1, 1))[0] == pytest.approx(1.0 + SQRT2)


@pytest.mark.parametrize(
    ("unknown_cost", "cost", "through"),
    [(1.0, 8.0, True), (2.0, 8.0 + 3.0, True), (1.7, 8.0 + 3 * 0.7, True), (2.5, 6 + 4 * SQRT2, False)],
)
def test_unknown_space_is_gone_through_or_around(unknown_cost, cost, through):
    """Three unknown columns, x = 3 … 5, y < 4, on the way from (0, 3) to (8, 3)."""
    mean, precision = known(np.zeros(FLAT, bool))
    precision[3:6, :4] = UNKNOWN
    around = 8.0 - 2.0 + 2.0 * SQRT2  # one row up before x = 3, down after x = 5
    expected = min(8.0 + 3.0 * (unknown_cost - 1.0), around)
    found, way = plan(mean, precision, (0, 3, 0), (8, 3, 0), unknown_cost=unknown_cost)
    assert found == pytest.approx(expected)
    assert (precision[tuple(way.T)] == UNKNOWN).any() == (expected < around)


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


@pytest.mark.parametrize("sources", [[(0, 1, 0), (8, 1, 0)], [(8, 1, 0), (0, 1, 0)]])
def test_of_sources_at_the_same_cost_the_first_has_the_voxel(sources):
    """The middle column x = 4 is as far from one as from the other."""
    free = belief_costs(*known(np.zeros(FLAT, bool)), PRIOR)
    found = geodesics(new_search(54), new_lattice(FLAT), free, flat_index(sources, FLAT))
    each = [octile(FLAT, source) for source in sources]
    np.testing.assert_allclose(found.cost, np.minimum(*each))
    tied = np.isclose(*each)
    assert tied[4].all() and tied.sum() == 6
    np.testing.assert_array_equal(found.cell, np.where(tied, 0, np.argmin(each, axis=0)))


def octile(shape, voxel):
    """Costs in free 2-D space."""
    x, y = np.abs(np.arange(shape[0]) - voxel[0])[:, None], np.abs(np.arange(shape[1]) - voxel[1])
    return (np.maximum(x, y) + (SQRT2 - 1.0) * np.minimum(x, y))[:, :, None]


def test_the_same_source_twice_is_the_first():
    costs = belief_costs(*known(np.zeros(SIZE, bool)), PRIOR)
    found = geodesics(new_search(385), new_lattice(SIZE), costs, [5, 5])
    assert (found.cell == 0).all()


def test_start_is_goal():
    mean, precision = known(np.zeros(SIZE, bool))
    cost, way = plan(mean, precision, (1, 2, 3), (1, 2, 3))
    assert cost == 0.0 and way.tolist() == [[1, 2, 3]]
    mean[1, 2, 3] = 1.0
    assert plan(mean, precision, (1, 2, 3), (1, 2, 3))[0] == 0.0


def test_a_goal_behind_walls_or_inside_one_is_not_reached():
    covered = np.zeros(SIZE, bool)
    covered[3] = True
    for goal in ((6, 10, 4), (3, 5, 2)):
        cost, way = plan(*known(covered), (0, 0, 0), goal)
        assert math.isinf(cost) and way.shape == (0, 3)


def test_a_start_inside_a_covered_voxel_may_be_left_and_not_entered_again():
    covered = np.zeros((5, 3, 1), bool)
    covered[2] = True
    cost, _ = plan(*known(covered), (2, 1, 0), (4, 1, 0))
    assert cost == 2.0
    costs, lattice = belief_costs(*known(covered), PRIOR), new_lattice((5, 3, 1))
    found = geodesics(new_search(15), lattice, costs, flat_index([(2, 1, 0), (0, 0, 0)], (5, 3, 1)))
    assert found.cell[4, 1, 0] == 0 and np.isinf(found.cost[2, 0, 0])
    behind, _ = plan(*known(covered), (0, 1, 0), (4, 1, 0))
    assert math.isinf(behind)


def test_a_body_that_touches_something_at_its_start_may_leave():
    """Radius 2.2, and a covered voxel beside the start: away from it goes the way, never into it."""
    covered = np.zeros((19, 11, 1), bool)
    covered[5, 5] = True
    start, goal = (6, 5, 0), (15, 5, 0)
    cost, way = plan(*known(covered), start, goal, radius=2.2)
    assert cost == pytest.approx(9.0)
    assert [5, 5, 0] not in way.tolist()
    # On the other side of it, around: the body's room begins where it touches nothing more.
    cost, way = plan(*known(covered), start, (2, 5, 0), radius=2.2)
    blocked = World(Grid(covered.shape, 1.0), covered, "by hand").collision_mask(2.2) > 0
    ball = [v for v in way.tolist() if blocked[tuple(v)]]
    assert all(math.dist(v, start) < 2.2 + 1.0 for v in ball) and not math.isinf(cost)


@pytest.mark.parametrize(("radius", "fits"), [(0.5, True), (1.4, True), (1.5, True), (1.6, False)])
def test_a_body_in_a_corridor(radius, fits):
    """A corridor three voxels wide: its middle is 1½ edges from either wall."""
    assert math.isinf(plan(*known(np.zeros((9, 3, 1), bool)), (2, 1, 0), (6, 1, 0), radius)[0]) != fits


def test_ways_beyond_reach_are_not_found():
    belief = known(np.zeros(FLAT, bool))
    assert plan(*belief, (0, 0, 0), (8, 0, 0), reach=8.0)[0] == 8.0
    assert math.isinf(plan(*belief, (0, 0, 0), (8, 0, 0), reach=7.999)[0])
    found = geodesics(new_search(54), new_lattice(FLAT), belief_costs(*belief, PRIOR), [0], reach=3.0)
    expected = octile(FLAT, (0, 0, 0))
    np.testing.assert_allclose(found.cost, np.where(expected <= 3.0, expected, math.inf))
    assert ((found.cell == UNREACHED) == (expected > 3.0)).all()


@drawn(40)
@given(st.sampled_from(SHAPES), seeds, st.lists(st.floats(0.0, 40.0), min_size=1, max_size=4))
def test_a_search_that_is_widened_finds_what_one_of_that_reach_finds(shape, seed, reaches):
    rates, lattice = random_rates(shape, seed, 1.0), new_lattice(shape)
    sources = np.random.default_rng(seed).integers(0, rates.size, 2).astype(np.int32)
    costs, search, cell = rate_costs(rates), new_search(rates.size), np.full(rates.size, UNREACHED, np.int32)
    begin_search(search, lattice, costs, sources, cell)
    found = np.empty(rates.size)
    for reach in (*sorted(reaches), math.inf):
        widen_search(search, lattice, costs, reach, cell)
        collect(search, found)
        expected = geodesics(new_search(rates.size), lattice, costs, sources, reach)
        within = found <= reach
        np.testing.assert_array_equal(np.where(within, found, math.inf), expected.cost.ravel())
        np.testing.assert_array_equal(np.where(within, cell, UNREACHED), expected.cell.ravel())


@drawn(20)
@given(st.sampled_from(SHAPES), st.lists(seeds, min_size=2, max_size=4))
def test_searches_do_not_disturb_later_ones(shape, several):
    search, lattice = new_search(math.prod(shape)), new_lattice(shape)
    for seed in several:
        rates = random_rates(shape, seed, 1.0)
        start, goal = np.random.default_rng(seed).integers(0, rates.size, 2).tolist()
        used = shortest_way(search, lattice, rate_costs(rates), start, goal)
        fresh = shortest_way(new_search(rates.size), lattice, rate_costs(rates), start, goal)
        assert used[0] == fresh[0]
        np.testing.assert_array_equal(used[1], fresh[1])


def test_marks_of_millions_of_searches_ago_do_not_count():
    rates, lattice = random_rates(SIZE, 3, 0.5), new_lattice(SIZE)
    search = new_search(rates.size)
    geodesics(search, lattice, rate_costs(random_rates(SIZE, 4, 0.5)), [7])
    search.searches[0] = 2**23 - 1
    found = geodesics(search, lattice, rate_costs(rates), [9])
    assert search.searches[0] == 1
    fresh = geodesics(new_search(rates.size), lattice, rate_costs(rates), [9])
    np.testing.assert_array_equal(found.cost, fresh.cost)


def test_a_full_queue_drops_what_is_out_of_date():
    """Rates from 1 to 10⁴ fill the queue with entries of voxels that were reached cheaper since."""
    shape = (60, 41, 1)
    rates, lattice = random_rates(shape, 1, 2.0, walls=0.0), new_lattice(shape)
    roomy, tight = new_search(rates.size), new_search(rates.size)
    expected = geodesics(roomy, lattice, rate_costs(rates), [5, 2000])
    used = int(roomy.queue.numbers["fresh"][0])
    tight = tight._replace(queue=tight.queue._replace(blocks=tight.queue.blocks[: used - 3]))
    found = geodesics(tight, lattice, rate_costs(rates), [5, 2000])
    np.testing.assert_array_equal(found.cost, expected.cost)
    np.testing.assert_array_equal(found.cell, expected.cell)


def test_a_search_leaves_the_memory_of_what_it_does_not_reach_alone():
    shape = (300, 200, 1)
    search, costs = new_search(60_000), belief_costs(*known(np.zeros(shape, bool)), PRIOR)
    search.cost[:] = -1.0
    sources = np.array(flat_index([(150, 100, 0)], shape), np.int32)
    search_ways(search, new_lattice(shape), costs, sources, -1, 5.0, NO_CELLS)
    assert 0 < np.count_nonzero(search.mark) <= 13 * 2 * 32  # looked at 32 at a time
    assert np.count_nonzero(search.cost != -1.0) <= 11 * 11


@pytest.mark.parametrize(
    ("ask", "field"),
    [
        (lambda: new_lattice(SIZE, -0.1), "body_radius"),
        (lambda: new_lattice(SIZE, math.nan), "body_radius"),
        (lambda: new_lattice(SIZE, 0.0, 5), "layer"),
        (lambda: belief_costs(*known(np.zeros(SIZE, bool)), PRIOR, 0.99), "unknown_cost"),
        (lambda: belief_costs(*known(np.zeros(SIZE, bool)), PRIOR, math.inf), "unknown_cost"),
        (lambda: rate_costs(np.zeros(SIZE, np.float32)), "rates"),
        (lambda: rate_costs(np.full(SIZE, math.nan, np.float32)), "rates"),
        (lambda: rate_costs(np.array([1.0, 1.1e6, math.inf], np.float32)), "rates"),
    ],
)
def test_what_is_refused(ask, field):
    with pytest.raises(SettingError) as raised:
        ask()
    assert raised.value.field == field


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"start": -1}, "start"),
        ({"goal": 385}, "goal"),
        ({"goal": 2.0}, "goal"),
        ({"start": 1}, "start"),
        ({"reach": -1.0}, "reach"),
        ({"reach": math.nan}, "reach"),
        ({"search": new_search(384)}, "search"),
        ({"costs": rate_costs(np.ones(386, np.float32))}, "costs"),
    ],
)
def test_what_a_way_refuses(change, field):
    costs = belief_costs(*known(np.zeros(SIZE, bool)), PRIOR)
    asked = {"search": new_search(385), "lattice": new_lattice(SIZE, 0.0, 2), "costs": costs}
    with pytest.raises(SettingError) as raised:
        shortest_way(**{**asked, "start": 2, "goal": 7, **change})
    assert raised.value.field == field
    with pytest.raises(SettingError, match="sources"):
        geodesics(asked["search"], asked["lattice"], costs, [])
