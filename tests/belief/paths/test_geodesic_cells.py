"""Geodesic Voronoi cells against SciPy's Dijkstra, by hand, and by what must hold of any cells."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import dijkstra

from entropy_explore_env.belief.paths.geodesic_cells import (
    UNREACHED,
    extract_path,
    new_tessellation,
    tessellate,
)
from entropy_explore_env.errors import SettingError
from tests.belief.paths.graphs import graph_of
from tests.reference.scenes import SHAPES, drawn, seeds


def slow_costs(graph, rates, sources):
    """(K, X, Y, Z) costs of the paths from each of some voxels to all; inf from one that is impassable."""
    costs = dijkstra(graph, indices=sources).reshape(-1, *rates.shape)
    costs[np.isinf(rates.ravel()[sources])] = math.inf
    return costs


def drawn_rates(size, seed, walls):
    """Traversal costs over four decades, and walls."""
    rng = np.random.default_rng(seed)
    rates = (10.0 ** rng.uniform(-2.0, 2.0, size)).astype(np.float32)
    rates[rng.random(size) < walls] = np.inf
    return rates, rng


@given(
    st.sampled_from(SHAPES), seeds, st.sampled_from([0.0, 0.3]), st.sampled_from([0.0, 0.7]), st.booleans()
)
@drawn(16)
def test_costs_and_cells_are_those_of_dijkstra(size, seed, walls, length_cost, by_length):
    rates, rng = drawn_rates(size, seed, walls)
    if np.isinf(rates).all():
        rates[0, 0, 0] = 1.0
    sources = rng.integers(0, rates.size, 3)
    space = new_tessellation(size)
    each = slow_costs(graph_of(rates, None, length_cost, by_length), rates, sources)
    for _ in range(2):  # the second time in the same space
        tessellate(space, rates, sources, length_cost, by_length)
        np.testing.assert_allclose(space.costs, each.min(axis=0), rtol=1e-9)
        reached = np.isfinite(space.costs)
        assert (space.cells[~reached] == UNREACHED).all()
        owned = np.take_along_axis(each, np.maximum(space.cells, 0)[None], axis=0)[0]
        np.testing.assert_allclose(owned[reached], space.costs[reached], rtol=1e-9)
        first = (each <= each.min(axis=0) * (1 + 1e-9)).argmax(axis=0)
        alone = (each > each.min(axis=0) * (1 + 1e-9)).sum(axis=0) == 2
        np.testing.assert_array_equal(space.cells[reached & alone], first[reached & alone])


def test_a_corridor_by_hand():
    """Two sources five voxels apart: the one in the middle goes to the first."""
    rates = np.ones((7, 1, 1), np.float32)
    rates[6] = np.inf
    space = new_tessellation((7, 1, 1))
    tessellate(space, rates, np.array([4, 0]))
    assert space.cells.ravel().tolist() == [1, 1, 0, 0, 0, 0, UNREACHED]
    assert space.costs.ravel().tolist() == [0.0, 1.0, 2.0, 1.0, 0.0, 1.0, math.inf]
    tessellate(space, rates, np.array([0, 4]), length_cost=0.5)
    assert space.cells.ravel().tolist() == [0, 0, 0, 1, 1, 1, UNREACHED]
    assert space.costs.ravel()[:4].tolist() == [0.0, 1.5, 3.0, 1.5]


def test_cost_of_a_diagonal_step_by_hand():
    rates = np.array([[2.0, 4.0, np.inf], [4.0, 6.0, np.inf]], np.float32)[:, :, None]
    space = new_tessellation((2, 3, 1))
    tessellate(space, rates, np.array([0]), length_cost=0.25)
    assert space.costs[1, 1, 0] == pytest.approx((4.0 + 0.25) * math.sqrt(2.0))
    tessellate(space, rates, np.array([0]), length_cost=0.25, by_length=False)
    assert space.costs[1, 1, 0] == pytest.approx(4.0 + 0.25 * math.sqrt(2.0))
    rates[0, 1] = np.inf  # no path cuts a corner
    tessellate(space, rates, np.array([0]), length_cost=0.25, by_length=False)
    assert space.costs[1, 1, 0] == pytest.approx(3.0 + 5.0 + 0.5)


@pytest.mark.parametrize("closed", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_no_corner_of_a_closed_voxel_is_cut_and_all_others_are(closed):
    """From the middle of a plane of 5 × 7, beside which one voxel is closed: √2 askew, 2 around."""
    rates = np.ones((5, 7, 1), np.float32)
    rates[2 + closed[0], 3 + closed[1], 0] = np.inf
    space = new_tessellation(rates.shape)
    tessellate(space, rates, np.array([2 * 7 + 3]), 0.0, True)
    for x, y in itertools.product((-1, 1), repeat=2):
        around = closed in ((x, 0), (0, y))
        assert space.costs[2 + x, 3 + y, 0] == pytest.approx(2.0 if around else math.sqrt(2.0))


def test_sources_that_are_impassable_or_share_a_voxel_get_no_cell():
    rates = np.ones((3, 4, 2), np.float32)
    rates[1, 2, 0] = np.inf
    wall = int(np.ravel_multi_index((1, 2, 0), rates.shape))
    space = new_tessellation(rates.shape)
    tessellate(space, rates, np.array([wall, 5, 5, 23]))
    assert set(np.unique(space.cells)) == {UNREACHED, 1, 3}
    assert (space.cells == UNREACHED).sum() == 1
    tessellate(space, rates, np.array([], np.int64))
    assert (space.cells == UNREACHED).all() and np.isinf(space.costs).all()


def test_costs_of_very_different_size_go_beyond_the_ring_of_buckets():
    rates = np.ones((5, 9, 1), np.float32)
    rates[2] = 1e6
    rates[:, 4] = 3e4
    space = new_tessellation(rates.shape)
    tessellate(space, rates, np.array([0, 44]))
    each = slow_costs(graph_of(rates), rates, [0, 44])
    np.testing.assert_allclose(space.costs, each.min(axis=0), rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"rates": np.ones((3, 4, 1), np.float32)}, "traversal_cost"),
        ({"rates": np.full((3, 5, 1), -1.0)}, "traversal_cost"),
        ({"rates": np.full((3, 5, 1), np.nan)}, "traversal_cost"),
        ({"rates": np.zeros((3, 5, 1))}, "traversal_cost"),
        ({"length_cost": -1.0}, "traversal_cost"),
        ({"length_cost": math.nan}, "traversal_cost"),
        ({"sources": np.array([15])}, "sources"),
        ({"sources": np.array([-1])}, "sources"),
        ({"rates": np.geomspace(1e-6, 1e6, 15).reshape(3, 5, 1)}, "traversal_cost"),
    ],
)
def test_what_is_refused(change, field):
    given_ = {"rates": np.ones((3, 5, 1)), "sources": np.array([0]), "length_cost": 0.0} | change
    space = new_tessellation((3, 5, 1))
    before = space.half_cost.copy()
    with pytest.raises(SettingError) as raised:
        tessellate(space, given_["rates"], given_["sources"], given_["length_cost"])
    assert raised.value.field == field and "\n" not in str(raised.value)
    np.testing.assert_array_equal(space.half_cost, before)


@drawn(30)
@given(st.sampled_from(SHAPES), seeds, st.sampled_from([0.0, 0.01, 0.7]), st.booleans())
def test_a_path_is_the_one_that_the_costs_of_its_cell_come_from(size, seed, length_cost, by_length):
    rates, rng = drawn_rates(size, seed, 0.3)
    sources = rng.integers(0, rates.size, 3)
    space = new_tessellation(rates.shape)
    tessellate(space, rates, sources, length_cost, by_length)
    costs, cells = space.costs.reshape(-1), space.cells.reshape(-1)
    graph = graph_of(rates, None, length_cost, by_length)
    for voxel in range(0, rates.size, 3):
        path = extract_path(space, rates, voxel, length_cost, by_length)
        if cells[voxel] == UNREACHED:
            assert len(path) == 0
            continue
        assert path[0] == sources[cells[voxel]] and path[-1] == voxel
        assert (cells[path] == cells[voxel]).all()
        steps = [graph[here, there] for here, there in itertools.pairwise(path.tolist())]
        assert all(step > 0.0 for step in steps) and sum(steps) == pytest.approx(costs[voxel], rel=1e-9)


def test_where_no_source_comes_and_for_other_costs_there_is_no_path():
    rates = np.ones((5, 3, 1), np.float32)
    rates[2] = np.inf
    space = new_tessellation(rates.shape)
    tessellate(space, rates, np.array([0]), 0.0, True)
    assert extract_path(space, rates, 14, 0.0, True).tolist() == []
    assert extract_path(space, rates, 0, 0.0, True).tolist() == [0]
    assert extract_path(space, rates, 5, 0.0, True).tolist() in ([0, 4, 5], [0, 1, 5])
    rates[1, 2] = np.inf
    assert extract_path(space, rates, 5, 0.0, True).tolist() == []


@pytest.mark.parametrize("sources", [[0, 4], [4, 0]])
@pytest.mark.parametrize("rates", [[1, 1, 1, 1, 1], [5, 1, 1, 3, 1], [1, 3, 1, 1, 5]])
def test_what_is_as_near_to_two_sources_belongs_to_the_earlier(sources, rates):
    """Whichever of the two comes to the middle first."""
    space = new_tessellation((5, 1, 1))
    tessellate(space, np.array(rates, np.float32).reshape(5, 1, 1), np.array(sources), 0.0, True)
    near, far = (0, 1) if sources[0] == 0 else (1, 0)
    assert space.cells.reshape(-1).tolist() == [near, near, 0, far, far]


def test_a_path_to_what_is_as_near_to_two_sources_does_not_leave_its_cell():
    space, rates = new_tessellation((5, 1, 1)), np.ones((5, 1, 1), np.float32)
    tessellate(space, rates, np.array([4, 0]), 0.0, True)
    assert extract_path(space, rates, 2, 0.0, True).tolist() == [4, 3, 2]
