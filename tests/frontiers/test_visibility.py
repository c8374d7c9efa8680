"""Expected visibility: beside a slow reference, by hand, and what promises do to it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.frontiers.visibility import (
    count_crossed,
    count_from,
    count_in_ball,
    forget_in_range,
    new_counter,
    rays_around,
    rays_towards,
)
from entropy_explore_env.frontiers.voxel_states import COVERED, UNEXPLORED
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
    many, values, voxels = np.empty(2), np.empty(2), np.array([0, 20 * 43 + 21], np.int32)
    count_from(counter, state.reshape(-1), shape, voxels, directions, reach, many, values)
    assert many[1] == seen and many[0] < seen / 3


@given(st.sampled_from(SHAPES), st.floats(0.6, 9.0), seeds)
@drawn(40)
def test_bounds_stay_bounds_when_walls_turn_out_free(shape, reach, seed):
    """They are forgotten, that is inf, in sight of the walls, and nowhere else."""
    state, _, rng = scene(shape, seed, covered=0.4)
    counter, flat, voxels = (
        new_counter(state.size, shape),
        state.reshape(-1),
        np.arange(state.size, dtype=np.int32),
    )
    bounds, now, weighed = np.empty((3, state.size))
    count_from(counter, flat, shape, voxels, rays(shape), reach, bounds, weighed)
    counted, walls = bounds.copy(), np.flatnonzero(flat & COVERED)
    opened = rng.choice(walls, min(int(rng.integers(0, 4)), len(walls)), replace=False).astype(np.int32)
    flat[opened] = UNEXPLORED
    forget_in_range(shape, opened, voxels, (reach + 2.0, 1.0), bounds)
    count_from(counter, flat, shape, voxels, rays(shape), reach, now, weighed)
    assert (bounds >= now).all()
    gaps = np.argwhere(np.ones(shape))[:, None] - np.argwhere(np.ones(shape))[opened][None]
    near = (np.linalg.norm(gaps, axis=2) <= reach + 2.0).any(axis=1)
    assert np.isinf(bounds[near]).all() and (bounds[~near] == counted[~near]).all()
