"""Lines of sight against dense sampling; string-pulled paths are free and never cost more."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.belief.paths.string_pulling import line_of_sight_cost, string_pulled
from tests.belief.paths.graphs import belief_costs, field_costs, shortest_path
from tests.reference.scenes import SHAPES, drawn, random_cover, seeds

SIZE = (7, 11, 5)


def sight(rates, start, finish):
    """The cost of a straight line through rates, in a search of its own."""
    search, lattice, costs = new_search(rates.size), new_lattice(rates.shape), field_costs(rates)
    shortest_path(search, lattice, costs, 0, 0)
    return line_of_sight_cost(search, lattice, costs, tuple(map(float, start)), tuple(map(float, finish)))


def sampled(rates, start, finish, samples=2000):
    """The same by points on the line; the start's voxel does not block."""
    share = (np.arange(samples) + 0.5) / samples
    points = np.asarray(start) + share[:, None] * (np.asarray(finish) - np.asarray(start))
    crossed = np.floor(points).astype(int)
    own = (crossed == np.floor(start).astype(int)).all(axis=1)
    values = rates[tuple(crossed.T)].astype(np.float64)
    values[own & np.isinf(values)] = rates[np.isfinite(rates)].min()
    return values.mean() * math.dist(start, finish)


def centre(voxel, shape):
    return np.array(np.unravel_index(int(voxel), shape)) + 0.5


@drawn(60)
@given(st.sampled_from(SHAPES), seeds, st.sampled_from([0.0, 0.08]))
def test_a_line_of_sight_costs_what_it_crosses(shape, seed, walls):
    rng = np.random.default_rng(seed)
    rates = rng.uniform(1.0, 3.0, shape).astype(np.float32)
    rates[rng.random(shape) < walls] = math.inf
    rates.ravel()[0] = 1.0
    start, finish = (rng.uniform(0.02, np.array(shape) - 0.02) for _ in range(2))
    ours, expected = sight(rates, start, finish), sampled(rates, start, finish)
    if math.isinf(ours) or math.isinf(expected):
        assert math.isinf(ours)  # samples may miss a corner that is cut
        assert math.isinf(expected) or shortest_crossing(rates, start, finish) < 5e-3
    else:
        assert ours == pytest.approx(expected, rel=5e-3)


def shortest_crossing(rates, start, finish):
    """Length of the shortest piece of the line inside an impassable voxel."""
    start, extent = np.asarray(start), np.asarray(finish) - np.asarray(start)
    least = math.inf
    for voxel in np.argwhere(np.isinf(rates)):
        ends = np.sort((np.stack([voxel, voxel + 1]) - start) / extent, axis=0)
        low, high = max(ends[0].max(), 0.0), min(ends[1].min(), 1.0)
        if high > low:
            least = min(least, (high - low) * math.dist(start, finish))
    return least


@pytest.mark.parametrize(
    ("solid", "finish", "free"),
    [
        ((1, 0, 0), (3.5, 3.5, 3.5), False),
        ((1, 1, 0), (3.5, 3.5, 3.5), False),
        ((1, 0, 0), (3.5, 3.5, 0.5), False),
        ((0, 0, 1), (3.5, 3.5, 0.5), True),
        ((3, 1, 0), (4.5, 2.5, 0.5), False),
        ((2, 1, 0), (4.5, 2.5, 0.5), False),
        ((1, 1, 0), (4.5, 2.5, 0.5), False),
        ((3, 2, 0), (4.5, 2.5, 0.5), False),
        ((0, 1, 0), (4.5, 2.5, 0.5), True),
    ],
)
def test_a_line_through_edges_and_corners_needs_the_voxels_beside_them(solid, finish, free):
    """From the centre of (0, 0, 0); to (4, 2, 0) the line goes through no edge, but four voxels."""
    rates = np.ones(SIZE, np.float32)
    rates[solid] = math.inf
    start = (0.5, 0.5, 0.5)
    expected = math.dist(start, finish) if free else math.inf
    crossed = {(1, 0, 0), (1, 1, 0), (2, 1, 0), (3, 1, 0), (3, 2, 0)}
    if finish == (4.5, 2.5, 0.5):
        assert free == (solid not in crossed)
    assert sight(rates, start, finish) == pytest.approx(expected)


@pytest.mark.parametrize("solid", [(1, 0, 0), (0, 1, 0), (2, 1, 0), (1, 2, 0)])
@pytest.mark.parametrize("off", [0.0, 3e-15, -3e-15, 2e-10, -2e-10])
def test_rounding_opens_no_corner(solid, off):
    """Lines from centre to centre, as they come out of metres: a corner stays one, on either side."""
    rates = np.ones(SIZE, np.float32)
    rates[solid] = math.inf
    for start, finish in (((0.5 + off, 0.5), (2.5, 2.5)), ((2.5, 2.5), (0.5, 0.5 - off))):
        assert math.isinf(sight(rates, (*start, 0.5), (*finish, 0.5)))
    beside = (0.5 + math.copysign(1e-4, solid[1] - solid[0]), 0.5, 0.5)
    assert math.isfinite(sight(rates, beside, (2.5 + beside[0] - 0.5, 2.5, 0.5)))


def test_a_line_that_ends_at_the_boundary_stays_inside():
    """Just before the outermost faces, next to the last edge that it crosses."""
    shape, end = (9, 6, 1), (9.0 - 1e-9, 4.0 + 1e-9, 0.5)
    start = (8.5, 4.0 - 0.5, 0.5)
    assert sight(np.ones(shape, np.float32), start, end) == pytest.approx(math.dist(start, end))


def pulled(mean, precision, start, goal, radius=0.0, layer=None, unknown_cost=1.0, ends=None):
    """Cost and voxels of the path, its waypoints, and the cost of each leg."""
    lattice = new_lattice(mean.shape, radius, layer)
    costs = belief_costs(mean, precision, 1e-3, unknown_cost)
    search = new_search(mean.size)
    cost, path = shortest_path(search, lattice, costs, start, goal)
    first, last = ends or (centre(start, mean.shape), centre(goal, mean.shape))
    if not len(path):
        return cost, path, None, None
    points = np.vstack([first, string_pulled(search, lattice, costs, path, first, last)])
    legs = [
        line_of_sight_cost(search, lattice, costs, tuple(a.tolist()), tuple(b.tolist()))
        for a, b in itertools.pairwise(points)
    ]
    return cost, path, points, legs


@drawn(50)
@given(
    st.sampled_from([*SHAPES, (31, 17, 1)]),
    seeds,
    st.sampled_from([0.0, 0.8, 1.3]),
    st.sampled_from([1.0, 3.0]),
)
def test_a_pulled_path_is_free_costs_no_more_and_turns_on_the_path(shape, seed, radius, unknown_cost):
    rng = np.random.default_rng(seed)
    mean = random_cover(shape, 0.1 if radius == 0.0 else 0.03, seed)
    precision = rng.choice([1e-3, 50.0], shape).astype(np.float32)
    start, goal = rng.integers(0, mean.size, 2).tolist()
    shift = rng.uniform(-0.45, 0.45, (2, 3)) * (1.0, 1.0, shape[2] > 1)
    ends = tuple(centre(voxel, shape) + by for voxel, by in zip((start, goal), shift, strict=True))
    for given_ends in (None, ends):
        cost, path, points, legs = pulled(
            mean, precision, start, goal, radius, None, unknown_cost, given_ends
        )
        if points is None:
            return
        assert np.isfinite(legs).all()
        slack = unknown_cost * np.abs(shift).sum() if given_ends else 0.0
        assert sum(legs) <= cost + slack + 1e-6
        centres = {tuple(centre(voxel, shape)) for voxel in path}
        assert all(tuple(point) in centres for point in points[1:-1].tolist())
        np.testing.assert_array_equal(points[-1], (given_ends or (0, centre(goal, shape)))[1])
        assert all(math.dist(a, b) > 0.0 for a, b in itertools.pairwise(points))


def test_a_body_at_the_goal_does_not_drive():
    mean, precision = np.zeros(SIZE, np.float32), np.full(SIZE, 50.0, np.float32)
    assert len(pulled(mean, precision, 17, 17)[2]) == 1
    place = centre(17, SIZE)
    points = pulled(mean, precision, 17, 17, ends=(place, place + 0.25))[2]
    assert points.tolist() == [place.tolist(), (place + 0.25).tolist()]
