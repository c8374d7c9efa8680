"""Frontiers and visibility over a height field: beside a slow reference, and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.frontiers.blocks import FIND_EDGES, NONE, mark_around, replace_unreached
from entropy_explore_env.frontiers.terrain_frontiers import (
    fill_column_costs,
    new_terrain_map,
    take_column,
    update_columns,
    update_terrain,
)
from entropy_explore_env.frontiers.terrain_visibility import (
    ViewModel,
    count_below,
    count_columns_from,
    count_columns_in_ball,
    fill_height_factors,
    mean_ground,
)
from entropy_explore_env.frontiers.visibility import new_counter
from tests.reference import sawhney as reference
from tests.reference.scenes import drawn, seeds

LEVELS = np.float32(4.0), np.float32(4.0)
SHAPE = (9, 13, 8)
CEILING = 7


def known_ground(ground, shape=SHAPE, ceiling=CEILING, radius=0.0, spacing=2):
    """A map in which the columns with ground ≥ 0 are known."""
    terrain = new_terrain_map(shape, radius, spacing, np.full(shape[:2], ceiling, np.int32))
    survey_ground(terrain, ground, shape)
    return terrain


def survey_ground(terrain, ground, shape=SHAPE):
    mean = np.where(np.arange(shape[2]) < ground[:, :, None], 0.9, 0.1).astype(np.float32)
    precision = np.where(ground[:, :, None] < 0, 0.1, 9.0) * np.ones(shape)
    update_terrain(terrain, mean.reshape(-1), precision.astype(np.float32).reshape(-1), LEVELS)


def hills(seed, known=0.7, shape=SHAPE):
    rng = np.random.default_rng(seed)
    ground = rng.integers(1, 5, shape[:2]).astype(np.int32)
    ground[rng.random(shape[:2]) > known] = NONE
    return ground, rng


def replaced(terrain, cost):
    """Replace candidates that (V,) path costs do not reach, as TerrainFrontiers does."""
    costs = np.empty(len(terrain.columns.state))
    fill_column_costs(terrain, cost, costs)
    replace_unreached(terrain.columns, costs)
    take_column(terrain, 0)


@given(seeds)
@drawn(30)
def test_ground_is_the_known_covered_voxel_below_a_known_free_one(seed):
    rng = np.random.default_rng(seed)
    mean = np.where(rng.random(SHAPE) < 0.5, 0.9, 0.1).astype(np.float32)
    precision = np.where(rng.random(SHAPE) < 0.3, 0.1, 9.0).astype(np.float32)
    terrain = new_terrain_map(SHAPE, 0.0, 3, np.full(SHAPE[:2], CEILING, np.int32))
    update_terrain(terrain, mean.reshape(-1), precision.reshape(-1), LEVELS)
    state = np.where(precision < 4.0, 3, 0) | np.where((mean > 0.5) & (precision >= 4.0), 4, 0)
    np.testing.assert_array_equal(terrain.ground, reference.ground_of(state))


@given(seeds, st.floats(0.5, 7.5), st.floats(3.0, 12.0), st.sampled_from([0.0, 0.3]))
@drawn(60)
def test_columns_are_those_whose_tops_rays_meet(seed, height, reach, min_tangent):
    ground, rng = hills(seed)
    x, y = int(rng.integers(0, 9)), int(rng.integers(0, 13))
    ground[x, y] = 0 if ground[x, y] == NONE else min(ground[x, y], int(height))
    terrain, eye = known_ground(ground), (x + 0.5, y + 0.5, height)
    angles = 0.05 + np.arange(24) * (2 * math.pi / 24)
    azimuths = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    average = mean_ground(terrain, x, y, 2)
    assert average == pytest.approx(reference.mean_height(terrain.ground, x, y, 2))
    heights = reference.surface(terrain.ground, eye, average, reach)
    unexplored = terrain.ground == NONE
    wanted = reference.seen_columns(heights, unexplored, eye, azimuths, reach, min_tangent)
    counter = new_counter(9 * 13, SHAPE)
    view_model = ViewModel(reach, min_tangent, 2, 0.5, 1.0, math.inf)
    points, value = count_below(counter, terrain, eye, average, azimuths, view_model, True)
    marked = {tuple(map(int, np.unravel_index(c, (9, 13)))) for c in np.flatnonzero(counter.promised)}
    assert (points, value, marked) == (len(wanted), len(wanted), wanted)
    assert count_below(counter, terrain, eye, average, azimuths, view_model, False)[1] == len(wanted) / 2
    ball = {
        (i, j)
        for i, j in np.argwhere(unexplored).tolist()
        if math.dist((i + 0.5, j + 0.5, heights[i, j]), eye) <= reach
    }
    assert count_columns_in_ball(counter, terrain, eye, average, view_model, False)[0] == len(ball)


def test_a_ridge_hides_the_valley_behind_it_by_hand():
    """Ground 1, a ridge of 4 at x = 4, unknown beyond: from 3 above the floor nothing is seen past it."""
    ground = np.ones((9, 3), np.int32)
    ground[4], ground[6:] = 4, NONE
    east = np.array([[1.0, 0.0]])
    counter, view_model = new_counter(27, (9, 3, 8)), ViewModel(10.0, 0.0, 2, 0.5, 1.0, math.inf)
    terrain = known_ground(ground, (9, 3, 8))
    for height, wanted in ((3.5, 0), (5.5, 1), (7.5, 2)):
        # z_av = 1: extrapolated 1 - d/10. From 5.5 over the ridge's far edge at d = 4.5: slope -1/3, which
        # meets height 0.4 … at d ≈ 15; from 7.5 slope -7/9: 0.2 … 0.4 at d ≈ 9; the last tops end at d = 8.5
        eye = (0.5, 1.5, height)
        found = count_below(counter, terrain, eye, 1.0, east, view_model, False)[0]
        heights = reference.surface(ground, eye, 1.0, 10.0)
        assert found == len(reference.seen_columns(heights, ground < 0, eye, east, 10.0, 0.0))
        assert found <= wanted
    ground[4] = 1
    flat = known_ground(ground, (9, 3, 8))
    assert count_below(counter, flat, (0.5, 1.5, 5.5), 1.0, east, view_model, False)[0] == 3
    x, y, _ = flat.size
    for outside in ((x, 1.5, 5.5), (x + 5.3, 1.5, 5.5), (0.5, y, 5.5), (-0.5, 1.5, 5.5), (0.5, -9.0, 5.5)):
        assert count_below(counter, flat, outside, 1.0, east, view_model, True) == (0, 0.0)


@pytest.mark.parametrize("radius", [0.0, 2.0, 4.0, 6.0])
def test_the_whole_body_counts_however_large_it_is(radius):
    footprint = new_terrain_map((20, 24, 16), radius, 3, np.full((20, 24), 16, np.int32)).footprint
    assert np.abs(footprint).max() == radius


def test_candidates_hang_above_the_edge_between_ground_and_ceiling():
    ground = np.ones((9, 13), np.int32)
    ground[5:] = NONE
    terrain = known_ground(ground)
    found = np.stack(np.unravel_index(terrain.voxel[terrain.voxel != NONE], SHAPE), axis=-1)
    assert set(found[:, 0]) == {4} and set(found[:, 1]) == set(range(0, 13, 2))
    assert set(found[:, 2]) == {2, 4, 6}  # a layer of air below, two apart, and below layer 7
    traversal_cost = terrain.traversal_cost.reshape(SHAPE)
    assert np.isfinite(traversal_cost[:5, :, 1:7]).all() and np.isinf(traversal_cost[5:]).all()
    assert np.isinf(traversal_cost[:, :, 0]).all() and np.isinf(traversal_cost[:, :, 7]).all()
    ground[5:7] = 2
    survey_ground(terrain, ground)
    found = np.stack(np.unravel_index(terrain.voxel[terrain.voxel != NONE], SHAPE), axis=-1)
    assert set(found[:, 0]) == {6} and set(found[:, 2]) == {3, 5}


def test_a_block_gives_a_column_that_was_reached_or_has_room_left():
    """Known ground at x = 0 and x = 2 in a block of four columns: the middle one first, then the other."""
    ground = np.full((4, 4), NONE, np.int32)
    ground[0, 1], ground[2, 1] = 1, 1
    terrain = known_ground(ground, (4, 4, 8), spacing=4)
    near, far = 2 * 4 + 1, 1
    assert terrain.columns.candidate[0] == near
    cost = np.full(4 * 4 * 8, np.inf)
    replaced(terrain, cost)
    assert terrain.columns.candidate[0] == near  # neither was reached
    cost[far * 8 + 2] = 3.0
    replaced(terrain, cost)
    assert terrain.columns.candidate[0] == far
    assert set(terrain.voxel[terrain.voxel != NONE] // 8) == {far}
    terrain.excluded[near * 8 :][:8] = 1
    mark_around(terrain.columns, 0, 0, FIND_EDGES)
    update_columns(terrain)
    assert terrain.columns.candidate[0] == far  # nothing is left above the middle one
    terrain.excluded[far * 8 :][:8] = 1
    mark_around(terrain.columns, 0, 0, FIND_EDGES)
    update_columns(terrain)
    assert terrain.columns.candidate[0] == NONE and (terrain.voxel == NONE).all()


def test_the_height_factor_by_hand():
    """(z_f - z_av)^γ z_f^(1 - γ), and nothing for places that are too high."""
    ground = np.full((9, 13), 2, np.int32)
    ground[7:] = NONE
    terrain = known_ground(ground)
    voxels = np.array([(4 * 13 + 5) * 8 + z for z in (3, 6)], np.int32)  # z_f = 3.5 and 6.5, z_av = 2
    view_model = ViewModel(10.0, 0.0, patch=1, gamma=0.5, unit=2.0, highest=9.0)
    factors = np.empty(2)
    for changed, wanted in (  # a layer is 2 m high
        ({}, [2.0 * math.sqrt(1.5 * 3.5), 2.0 * math.sqrt(4.5 * 6.5)]),
        ({"gamma": 1.0, "highest": 4.0}, [2.0 * 1.5, 0.0]),
        ({"gamma": -1.0, "highest": 4.0}, [1.0, 0.0]),
    ):
        fill_height_factors(terrain, voxels, view_model._replace(**changed), factors)
        assert factors.tolist() == pytest.approx(wanted)
    seen, weighed, counter = np.empty(2), np.empty(2), new_counter(9 * 13, SHAPE)
    east = np.array([[1.0, 0.0]])
    count_columns_from(counter, terrain, voxels, east, view_model, seen, weighed)
    assert seen.tolist() == weighed.tolist() == [1.0, 2.0]  # from 3.5 it ends on the line over the edge
