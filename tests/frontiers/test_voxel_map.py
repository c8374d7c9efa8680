"""Frontier candidates of a map, kept up to date: beside a slow reference, and by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from entropy_explore_env.frontiers.blocks import (
    CANDIDATE,
    DROPPED,
    FIND_EDGES,
    NONE,
    mark_around,
    new_blocks,
)
from entropy_explore_env.frontiers.voxel_map import AT_ONCE, body_footprint, update_voxels
from entropy_explore_env.frontiers.voxel_states import COVERED, UNEXPLORED, UNMAPPED, new_states
from tests.reference import sawhney as reference
from tests.reference.scenes import drawn, seeds

LEVELS, FINER = (np.float32(4.0), np.float32(1.0)), (np.float32(8.0), np.float32(1.0))
SHAPES = ((7, 11, 1), (9, 6, 1), (4, 7, 5), (13, 2, 3))


def random_map(shape, rng):
    """Mean and precision in patches, so that there is room for bodies."""
    mean = np.where(rng.random(shape) < 0.1, 0.9, 0.1).astype(np.float32)
    precision = np.where(rng.random(shape) < 0.25, 0.5, 9.0).astype(np.float32)
    precision[rng.random(shape) < 0.1] = 2.0
    return mean, precision


def state_of(mean, precision, levels=LEVELS):
    state = np.where(precision < levels[0], UNEXPLORED, 0) | np.where(precision < levels[1], UNMAPPED, 0)
    return state | np.where((mean > 0.5) & (precision >= levels[1]), COVERED, 0)


def new_voxel_map(shape, radius, layer, spacing):
    """States, blocks and traversal costs of which nothing is explored."""
    states = new_states(shape, AT_ONCE)
    blocks = new_blocks(shape, states.state, body_footprint(shape, radius, layer), layer, spacing)
    return SimpleNamespace(
        states=states, blocks=blocks, traversal_cost=np.full(len(states.state), np.inf, np.float32)
    )


def updated(frontiers, mean, precision, levels=LEVELS):
    maps = frontiers.states, frontiers.blocks, frontiers.traversal_cost
    return update_voxels(*maps, mean.reshape(-1), precision.reshape(-1), levels)


def test_large_maps_are_read_part_by_part():
    rng, shape = np.random.default_rng(0), (300, 500, 1)
    assert np.prod(shape) > 2 * AT_ONCE
    frontiers = new_voxel_map(shape, 1.0, 0, 4)
    for _ in range(2):
        mean, precision = random_map(shape, rng)
        before = frontiers.states.state.copy()
        changed = updated(frontiers, mean, precision)
        assert np.array_equal(frontiers.states.state, state_of(mean, precision).reshape(-1))
        assert changed == (frontiers.states.state != before).sum()


@given(st.sampled_from(SHAPES), st.sampled_from([0.0, 1.0, 1.3]), st.integers(1, 4), seeds)
@drawn(40)
def test_candidates_and_rates_are_those_of_the_definition_after_every_change(shape, radius, spacing, seed):
    rng = np.random.default_rng(seed)
    layer = 0 if shape[2] == 1 else None
    frontiers = new_voxel_map(shape, radius, layer, spacing)
    mean, precision = random_map(shape, rng)
    for levels in (LEVELS, LEVELS, FINER, FINER):
        updated(frontiers, mean, precision, levels)
        state = state_of(mean, precision, levels)
        np.testing.assert_array_equal(frontiers.states.state.reshape(shape), state)
        ball = frontiers.blocks.footprint.tolist()
        np.testing.assert_array_equal(
            np.isfinite(frontiers.traversal_cost.reshape(shape)), reference.standing(state, ball)
        )
        wanted = reference.candidates(state, ball)
        np.testing.assert_array_equal((frontiers.blocks.flags & CANDIDATE > 0).reshape(shape), wanted)
        check_blocks(frontiers, wanted, spacing)
        here = tuple(rng.integers(0, n) for n in shape)
        patch = tuple(slice(max(i - 1, 0), i + 2) for i in here)
        precision[patch] += rng.choice([0.5, 9.0])
        mean[patch] = rng.choice([0.1, 0.9])


def random_patch(shape, rng):
    """Up to three voxels along each axis."""
    low, wide = rng.integers(0, shape), rng.integers(1, 4, 3)
    return tuple(slice(i, i + n) for i, n in zip(low, wide, strict=True))


@given(st.sampled_from([(9, 6, 7), (5, 11, 8)]), st.sampled_from([1.0, 1.3, 2.0]), st.integers(2, 4), seeds)
@drawn(10)
def test_in_space_voxels_change_to_and_fro_and_edges_are_dropped_and_restored(shape, radius, spacing, seed):
    """Free voxels become covered or unmapped and free again; all is counted anew beside it."""
    rng = np.random.default_rng(seed)
    frontiers = new_voxel_map(shape, radius, None, spacing)
    blocks, ball = frontiers.blocks, frontiers.blocks.footprint.tolist()
    body = np.zeros((2 * blocks.reach + 1,) * 3, int)
    body[tuple((blocks.footprint + blocks.reach).T)] = 1
    mean, precision = np.full(shape, 0.1, np.float32), np.full(shape, 9.0, np.float32)
    dropped = np.zeros(shape, bool)
    for _ in range(8):
        patch, before = random_patch(shape, rng), dropped.copy()
        mean[patch], precision[patch] = rng.choice([0.1, 0.9]), rng.choice([0.5, 2.0, 9.0])
        dropped[random_patch(shape, rng)] = rng.random() < 0.7
        blocks.flags[dropped.ravel()] |= DROPPED
        blocks.flags[~dropped.ravel()] &= np.uint8(0xFF ^ DROPPED)
        for voxel in np.flatnonzero(dropped != before):
            mark_around(blocks, voxel, blocks.reach, FIND_EDGES)
        updated(frontiers, mean, precision)
        state = state_of(mean, precision)
        free = (state & (UNMAPPED | COVERED) == 0).astype(int)
        touched = ndimage.correlate(free, body, mode="constant")
        np.testing.assert_array_equal(blocks.free.reshape(shape), touched)
        standing = np.isfinite(frontiers.traversal_cost.reshape(shape))
        np.testing.assert_array_equal(standing, touched == len(ball))
        wanted = reference.candidates(state, ball, dropped)
        np.testing.assert_array_equal((blocks.flags & CANDIDATE > 0).reshape(shape), wanted)
        check_blocks(frontiers, wanted, spacing)


def check_blocks(frontiers, wanted, spacing):
    """One candidate a block that has any: none is nearer to its middle."""
    shape = wanted.shape
    across = (spacing, spacing, shape[2] if shape[2] == 1 else spacing)
    of_block = np.full(frontiers.blocks.blocks, NONE)
    for place in np.argwhere(wanted):
        block = tuple(place // across)
        low = np.array(block) * across
        middle = 0.5 * (low + np.minimum(low + across, shape))
        apart = ((place + 0.5 - middle) ** 2).sum()
        found = frontiers.blocks.candidate.reshape(frontiers.blocks.blocks)[block]
        assert found != NONE
        chosen = np.stack(np.unravel_index(found, shape))
        assert wanted[tuple(chosen)] and ((chosen + 0.5 - middle) ** 2).sum() <= apart + 1e-9
        of_block[block] = found
    np.testing.assert_array_equal(frontiers.blocks.candidate.reshape(frontiers.blocks.blocks), of_block)


def test_a_corridor_by_hand():
    """Nine voxels in a row, the first five explored: the fifth is the frontier, and moves on."""
    mean, precision = np.full((9, 3, 1), 0.9, np.float32), np.full((9, 3, 1), 9.0, np.float32)
    mean[:, 1], precision[5:] = 0.1, 0.5
    frontiers = new_voxel_map((9, 3, 1), 0.0, 0, 2)
    updated(frontiers, mean, precision)
    assert frontiers.blocks.candidate[frontiers.blocks.candidate != NONE].tolist() == [4 * 3 + 1]
    precision[5:7] = 9.0
    updated(frontiers, mean, precision)
    block = np.flatnonzero(frontiers.blocks.candidate != NONE)
    assert frontiers.blocks.candidate[block].tolist() == [6 * 3 + 1]
    precision[:] = 9.0
    updated(frontiers, mean, precision)
    assert (frontiers.blocks.candidate == NONE).all()


def test_where_more_may_be_visible_is_noted_by_hand():
    """Of twelve covered voxels one becomes free; then all are asked for at a finer level."""
    mean, precision = np.full(12, 0.9, np.float32), np.full(12, 9.0, np.float32)
    voxels = new_voxel_map((4, 3, 1), 0.0, 0, 2)
    states = voxels.states
    updated(voxels, mean, precision)
    assert states.opened_count[0] == 0
    mean[7], precision[7] = 0.1, 10.0
    assert updated(voxels, mean, precision) == 1
    assert states.opened_count[0] == 1 and states.opened[0] == 7
    states.opened_count[0] = 0
    updated(voxels, mean, precision, (np.float32(16.0), np.float32(1.0)))
    assert states.opened[: states.opened_count[0]].tolist() == list(range(12))  # all is unexplored again
