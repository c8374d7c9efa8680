"""Expected visibility: beside a slow reference, by hand, and what promises do to it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.frontiers.blocks import COVERED, UNEXPLORED
from entropy_explore_env.frontiers.ray_tree import grow_tree, rays_around, rays_towards
from entropy_explore_env.frontiers.visibility import (
    count_crossed,
    count_from,
    count_in_ball,
    new_counter,
    raise_bounds,
)
from tests.reference import sawhney as reference
from tests.reference.scenes import drawn, seeds

SHAPES = ((7, 11, 1), (9, 6, 1), (5, 8, 4))


def scene(shape, seed, covered=0.15):
    """A random state, and the centre of a voxel that is not covered."""
    rng = np.random.default_rng(seed)
    state = np.where(rng.random(shape) < 0.5, UNEXPLORED, 0).astype(np.uint8)
    state[rng.random(shape) < covered] |= COVERED
    place = tuple(int(rng.integers(0, n)) for n in shape)
    state[place] = 0
    return state, tuple(i + 0.5 for i in place), rng


def rays(shape, count=17):
    pitches = np.zeros(1) if shape[2] == 1 else np.array([-0.83, 0.11, 0.62])
    return rays_towards(0.123 + np.arange(count) * (2 * math.pi / count), pitches)


@given(st.sampled_from(SHAPES), st.floats(1.0, 9.0), seeds)
@drawn(60)
def test_points_are_those_that_rays_cross(shape, reach, seed):
    state, start, _ = scene(shape, seed)
    wanted = reference.seen_voxels(state, start, rays(shape), reach)
    counter = new_counter(state.size, shape)
    points, value = count_crossed(counter, state.reshape(-1), shape, start, rays(shape), reach, True)
    assert (points, value) == (len(wanted), len(wanted))
    marked = {tuple(map(int, np.unravel_index(v, shape))) for v in np.flatnonzero(counter.promised)}
    assert marked == wanted


@given(st.sampled_from(SHAPES), seeds)
@drawn(30)
def test_promises_weigh_one_over_one_and_their_number(shape, seed):
    state, start, rng = scene(shape, seed)
    counter, flat, directions = new_counter(state.size, shape), state.reshape(-1), rays(shape)
    promised: dict[tuple[int, ...], int] = {}
    for _ in range(int(rng.integers(1, 4))):
        other = tuple(int(rng.integers(0, n)) + 0.5 for n in shape)
        count_crossed(counter, flat, shape, other, directions, 6.0, True)
        for point in reference.seen_voxels(state, other, directions, 6.0):
            promised[point] = promised.get(point, 0) + 1
    wanted = reference.seen_voxels(state, start, directions, 5.0)
    _, value = count_crossed(counter, flat, shape, start, directions, 5.0, False)
    assert value == pytest.approx(reference.weighed(wanted, promised))


def test_by_hand():
    """A wall behind which nothing counts; the first promise halves, the second leaves a third."""
    state = np.full((6, 3, 1), UNEXPLORED, np.uint8)
    state[0, 1], state[3, 1] = 0, COVERED
    east = np.array([[1.0, 0.0, 0.0]])
    counter, start = new_counter(18, (6, 3, 1)), (0.5, 1.5, 0.5)
    for value in (2.0, 1.0, 2.0 / 3.0):
        assert count_crossed(counter, state.reshape(-1), (6, 3, 1), start, east, 9.0, True) == (
            2,
            pytest.approx(value),
        )
    assert count_crossed(counter, state.reshape(-1), (6, 3, 1), start, east, 1.0, False)[0] == 1
    assert count_in_ball(counter, state.reshape(-1), (6, 3, 1), start, 1.0, False)[0] == 3  # behind no wall


def test_more_that_is_mapped_never_shows_more():
    """What makes a count an upper bound of later ones."""
    state, start, rng = scene((9, 12, 1), 5, covered=0.0)
    counter, flat, before = new_counter(state.size, state.shape), state.reshape(-1), math.inf
    for _ in range(40):
        points, _ = count_crossed(counter, flat, state.shape, start, rays(state.shape, 40), 7.0, False)
        assert points <= before
        before = points
        voxel = int(rng.choice(np.flatnonzero(flat & UNEXPLORED)))
        flat[voxel] = rng.choice([0, COVERED])


def test_rays_around_miss_no_voxel_within_reach():
    shape, reach = (41, 43, 1), 18.0
    state = np.full(shape, UNEXPLORED, np.uint8)
    counter, start = new_counter(state.size, shape), (20.5, 21.5, 0.5)
    directions = rays_around(reach, np.zeros(1))
    seen, _ = count_crossed(counter, state.reshape(-1), shape, start, directions, reach, False)
    inside, _ = count_in_ball(counter, state.reshape(-1), shape, start, reach - 0.75, False)
    assert seen >= inside
    many, values = np.empty(2), np.empty(2)
    voxels, tree = np.array([0, 20 * 43 + 21], np.int32), grow_tree(directions, reach, shape)
    count_from(counter, state.reshape(-1), shape, voxels, tree, np.empty(tree.cells, np.int32), many, values)
    assert many[1] == seen and many[0] < seen / 3


@given(st.sampled_from(SHAPES), st.floats(0.3, 9.0) | st.just(math.inf), st.booleans(), seeds)
@drawn(60)
def test_a_tree_of_rays_sees_from_every_voxel_what_the_rays_see(shape, reach, promised, seed):
    state, _, rng = scene(shape, seed)
    counter, flat, directions = new_counter(state.size, shape), state.reshape(-1), rays(shape)
    for _ in range(2 * promised):
        other = tuple(int(rng.integers(0, n)) + 0.5 for n in shape)
        count_crossed(counter, flat, shape, other, directions, 6.0, True)
    voxels, seen, weighed = np.arange(state.size, dtype=np.int32), *np.empty((2, state.size))
    tree = grow_tree(directions, reach, shape)
    count_from(counter, flat, shape, voxels, tree, np.empty(tree.cells, np.int32), seen, weighed)
    for voxel, points, value in zip(voxels, seen, weighed, strict=True):
        start = tuple(int(i) + 0.5 for i in np.unravel_index(voxel, shape))
        wanted = count_crossed(counter, flat, shape, start, directions, reach, False)
        assert (points, value) == (wanted[0], pytest.approx(wanted[1]))


def test_what_rays_share_is_walked_once():
    """By hand: east, and two more that leave it after two and three voxels."""
    directions = np.array([[1.0, 0.0, 0.0], [1.0, 0.25, 0.0], [1.0, 0.19, 0.0]])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    tree = grow_tree(directions, 4.2, (20, 9, 1))
    assert tree.low == (0, 0, 0) and tree.high == (4, 1, 0)
    assert tree.steps.tolist() == [
        *([0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [3, 1, 0], [4, 1, 0]),
        *([3, 0, 0], [3, 1, 0], [4, 1, 0], [4, 0, 0]),
    ]
    assert tree.after.tolist() == [10, 10, 10, 6, 6, 6, 10, 9, 9, 10]
    behind = tree.behind[6:11, 6:8, 0]  # from the middle of the box on
    assert behind.tolist() == [[10, 0], [9, 0], [8, 3], [4, 2 + 2], [1, 1 + 1]]
    assert behind.sum() == tree.behind.sum()
    assert tree.offset.tolist() == [9 * x + y for x, y, _ in tree.steps.tolist()]


@given(st.sampled_from(SHAPES), st.floats(0.6, 9.0) | st.just(math.inf), seeds)
@drawn(80)
def test_bounds_stay_bounds_when_walls_turn_out_free(shape, reach, seed):
    state, _, rng = scene(shape, seed, covered=0.4)
    counter, flat = new_counter(state.size, shape), state.reshape(-1)
    tree, voxels = grow_tree(rays(shape), reach, shape), np.arange(-1, state.size, dtype=np.int32)
    counted, now, _ = np.empty((3, state.size))
    count_from(counter, flat, shape, voxels[1:], tree, np.empty(tree.cells, np.int32), counted, _)
    seen = np.concatenate([[5.0], counted])
    seen[3] = math.inf
    walls = np.flatnonzero(flat & COVERED)
    opened = rng.choice(walls, min(int(rng.integers(0, 4)), len(walls)), replace=False).astype(np.int32)
    flat[opened] = UNEXPLORED
    raise_bounds(shape, opened, voxels, tree, seen)
    count_from(counter, flat, shape, voxels[1:], tree, np.empty(tree.cells, np.int32), now, _)
    assert (seen[1:] >= now).all()
    assert seen[0] == 5.0 and math.isinf(seen[3])
    opened_ones = np.zeros(shape, np.uint8)
    opened_ones.reshape(-1)[opened] = UNEXPLORED
    starts, far = np.argwhere(np.ones(shape)) + 0.5, min(reach, 99.0)
    crossed = [bool(reference.seen_voxels(opened_ones, at, rays(shape), far)) for at in starts]
    crossed[2] = True  # nothing was known of it
    untouched = ~np.array(crossed)
    assert (seen[1:][untouched] == counted[untouched]).all()


def test_behind_a_wall_that_turned_out_free_by_hand():
    """Looking east along six voxels, the wall at 3 hides two: with it three more may be seen, from 4 none."""
    shape, east = (6, 1, 1), np.array([[1.0, 0.0, 0.0]])
    tree, seen = grow_tree(east, 2.6, shape), np.array([2.0, 0.0])
    voxels, wall = np.array([1, 4], np.int32), np.array([3], np.int32)
    raise_bounds(shape, wall, voxels, tree, seen)
    assert seen.tolist() == [4.0, 0.0]  # the ray ends in the voxel at 4
