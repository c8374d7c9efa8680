"""Connected free space: pockets filled and ways cut, by hand and by a slow search."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.errors import WorldError
from entropy_explore_env.worlds.components import largest_component
from entropy_explore_env.worlds.recipes.connectivity import body_room, cut_gates, fill_pockets
from tests.reference.scenes import drawn, flood, random_cover, seeds


@drawn(40)
@given(seeds, st.sampled_from([(17, 11, 5), (23, 13)]), st.sampled_from([0.25, 0.6]))
def test_filled_space_is_connected_and_only_more_is_solid(seed, size, edge_m):
    occupied = random_cover((*size, 1)[:3], 0.25 if edge_m > 0.5 else 0.04, seed).reshape(size) > 0.5
    try:
        filled = fill_pockets(occupied, edge_m)
    except WorldError as error:
        assert error.field == "Grid.shape"
        return
    assert not (occupied & ~filled).any()
    for room in (body_room(filled, edge_m), ~filled):
        voxels = [tuple(voxel) for voxel in np.argwhere(room).tolist()]
        assert flood(room, voxels[0]) == set(voxels)
    # Nothing is lost that was in the largest part and away from every pocket:
    main = largest_component(body_room(occupied, edge_m))
    assert body_room(filled, edge_m).sum() >= 0.5 * main.sum()


def test_a_pocket_by_hand():
    """Voxels of 0.5 m, bodies of 0.3 m: a place needs its four neighbours free, not those at corners."""
    occupied = np.ones((13, 9), bool)
    occupied[1:7, 2:7] = False
    occupied[8:11, 3:6] = False
    occupied[7, 4] = False  # a slit, too narrow for bodies, not for rays
    room = body_room(occupied, 0.5)
    expected = np.zeros((13, 9), bool)
    expected[2:6, 3:6] = True
    expected[6, 4] = expected[8, 4] = expected[9, 4] = True
    np.testing.assert_array_equal(room, expected)
    filled = fill_pockets(occupied, 0.5)
    assert filled[8:11, 3:6].all() and not filled[7, 4]  # the chamber is gone, the slit stays
    expected[8, 4] = expected[9, 4] = False
    np.testing.assert_array_equal(body_room(filled, 0.5), expected)


def test_what_hangs_on_nothing_is_filled():
    occupied = np.zeros((7, 11, 5), bool)
    occupied[2:5, 2:5, 1:4] = True
    occupied[3, 3, 2] = False
    expected = occupied.copy()
    expected[3, 3, 2] = True
    np.testing.assert_array_equal(fill_pockets(occupied, 1.0), expected)
    assert not occupied[3, 3, 2]  # a copy


def test_space_too_narrow_for_any_body_is_refused():
    for occupied in (np.ones((7, 11), bool), np.arange(77).reshape(7, 11) % 2 == 0):
        with pytest.raises(WorldError, match=r"room for a body of 0\.3 m radius"):
            fill_pockets(occupied, 0.3)


def test_gates_join_two_rooms():
    for seed in range(10):
        solid = np.ones((31, 23), bool)
        solid[2:12, 3:20] = False
        solid[17:29, 8:15] = False
        room = body_room(solid, 0.25)
        parts = np.zeros((2, 31, 23), bool)
        parts[0, :14], parts[1, 14:] = room[:14], room[14:]
        before = solid.copy()
        cut_gates(solid, *parts, 1, 1.0, 0.25, np.random.default_rng(seed))
        joined = body_room(solid, 0.25)
        assert largest_component(joined).sum() == joined.sum() > parts.sum()
        opened = np.argwhere(before & ~solid)
        assert (opened[:, 0] >= 12).all() and (opened[:, 0] <= 20).all()
        assert (opened[:, 0] == 13).sum() == 5  # 1 m: four voxels, and the one in the middle
