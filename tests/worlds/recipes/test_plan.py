"""Floor plans: passages that a body fits through and no narrower, rooms in a row, doors and lintels."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.plan import (
    Rectangle,
    bare_plan,
    divided,
    extruded,
    passage_voxels,
    put_rooms,
    require_size,
    voxels,
)
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import drawn, seeds

EDGES_M = (0.05, 0.07, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.59, 0.6, 0.61, 1.0, 2.0)


def fits(width, edge_m, body_m):
    """Whether a body comes through a way of so many voxels between two walls, in a 2-D world."""
    occupied = np.ones((5 * width + 90, width + 2, 1), bool)
    occupied[:, 1:-1] = False
    world = World(Grid(occupied.shape, edge_m), occupied, "way")
    middle = (world.collision_mask(body_m) == 0)[occupied.shape[0] // 2]
    return bool(middle.any())


@pytest.mark.parametrize("body_m", [0.2, 0.3, 0.45])
@pytest.mark.parametrize("edge_m", EDGES_M)
def test_a_passage_is_no_narrower_than_the_body_nor_than_asked(edge_m, body_m):
    narrowest = passage_voxels(0.0, edge_m, body_m)
    assert fits(narrowest, edge_m, body_m)
    assert narrowest == 1 or not fits(narrowest - 1, edge_m, body_m)
    door = passage_voxels(0.9, edge_m, body_m)
    assert door * edge_m >= 0.9 - 1e-9 and fits(door, edge_m, body_m)
    assert door == narrowest or (door - 1) * edge_m < 0.9


def test_lengths_in_voxels():
    assert [voxels(length, 0.25) for length in (0.0, 0.1, 0.3, 1.0, 1.15)] == [1, 1, 1, 4, 5]
    assert passage_voxels(0.9, 0.1) == 9 and passage_voxels(0.9, 0.25) == 4
    assert passage_voxels(0.9, 0.5) == 3  # two would leave a body 0.25 m to one side
    assert passage_voxels(0.9, 1.0) == 1


@drawn(60)
@given(seeds, st.integers(0, 20), st.integers(3, 300), st.floats(3.0, 40.0), st.integers(0, 3))
def test_an_interval_is_divided_into_parts_of_about_the_same_length(seed, low, length, part, gap):
    parts = divided(low, low + length, part, gap, np.random.default_rng(seed))
    assert parts[0][0] == low and parts[-1][1] == low + length
    assert all(after[0] - before[1] == gap for before, after in pairwise(parts))
    if len(parts) > 1:
        mean = (length + gap) / len(parts)
        lengths = np.array([high - start + gap for start, high in parts])
        assert 0.6 * mean - 1 <= lengths.min() and lengths.max() <= 1.4 * mean + 1
        assert abs(len(parts) - (length + gap) / (part + gap)) <= 0.5


@pytest.mark.parametrize(("axis", "high"), [(0, True), (0, False), (1, True), (1, False)])
def test_rooms_in_a_row(axis, high):
    """21 × 4 m beside a corridor of 2 m: five rooms, each with a door of 9 voxels to the corridor."""
    shape = (210, 60) if axis == 0 else (60, 210)
    for seed in range(5):
        plan = bare_plan(shape, 0.1)
        band = plan.whole.within(1 - axis, *((0, 40) if high else (20, 60)))
        put_rooms(plan, band, axis, high, 4.0, np.random.default_rng(seed))
        solid, across = (plan.solid, 39 if high else 20) if axis == 0 else (plan.solid.T, 39 if high else 20)
        assert len(plan.rooms) == 5
        assert (~solid[:, across]).sum() == 5 * 9
        for room in plan.rooms:
            assert not plan.solid[room.window].any()
            assert (~solid[slice(room.low[axis], room.high[axis]), across]).sum() == 9
            assert room.extent(1 - axis) == 39
        corridor = solid[:, 40:] if high else solid[:, :20]
        assert not corridor.any()
        for door in plan.doors:
            assert sorted((door.extent(0), door.extent(1))) == [1, 9]
            assert plan.clear[door.window].all()
        assert not (plan.clear & plan.solid).sum() > 2 * 9 * len(plan.doors)


def test_the_way_through_a_door_is_clear_on_both_sides():
    plan = bare_plan((30, 40), 0.3)
    wall = Rectangle((10, 0), (11, 40))
    plan.put_wall(wall)
    plan.cut_door(wall, 1, np.random.default_rng(0))
    (door,) = plan.doors
    assert door.low[0] == 10 and door.extent(1) == 3
    expected = np.zeros((30, 40), bool)
    expected[7:14, door.low[1] : door.high[1]] = True
    np.testing.assert_array_equal(plan.clear, expected)
    assert plan.solid.sum() == 37 and not plan.solid[door.window].any()


def test_plans_are_raised_and_doors_have_lintels():
    solid = np.zeros((7, 11), bool)
    solid[3] = True
    door = Rectangle((3, 4), (4, 8))
    solid[door.window] = False
    occupied = extruded(Grid((7, 11, 10), 0.25), solid, [door])
    np.testing.assert_array_equal(occupied[:, :, 0], solid)
    assert not occupied[3, 4:8, :9].any()  # 2.1 m is 9 voxels of 0.25 m
    assert occupied[3, 4:8, 9].all()
    np.testing.assert_array_equal(extruded(Grid((7, 11, 1), 0.25), solid, [door])[:, :, 0], solid)


def test_too_small_a_workspace_is_named():
    require_size(Grid((40, 30, 1), 0.1), "a hut", 4.0, 3.0)
    require_size(Grid((30, 40, 7), 0.1), "a hut", 4.0, 3.0)
    with pytest.raises(WorldError) as raised:
        require_size(Grid((39, 31, 1), 0.1), "a hut", 4.0, 3.0)
    assert str(raised.value) == "Grid.shape = (39, 31, 1): expected at least 4 × 3 m for a hut"
    with pytest.raises(WorldError, match=r"at least 4 × 3 m for a hut, 2-D or 0\.6 m high"):
        require_size(Grid((40, 31, 6), 0.1), "a hut", 4.0, 3.0)
