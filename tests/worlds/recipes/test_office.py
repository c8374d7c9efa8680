"""Offices: rooms that a body enters through doors, corridors that a body turns in, lintels and furniture."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from entropy_explore_env.settings.scenarios import OFFICE, OFFICE_3D
from entropy_explore_env.worlds.recipes.office import office, office_plan
from entropy_explore_env.worlds.world import World


@pytest.mark.parametrize(("shape", "rooms"), [((240, 180), 24), ((120, 70), 6), ((90, 330), 16)])
def test_rooms_cover_most_of_the_plan_and_all_have_a_door(shape, rooms):
    for seed in range(10):
        plan = office_plan(shape, 0.1, np.random.default_rng(seed))
        assert abs(len(plan.rooms) - rooms) <= 4
        inside = np.zeros(shape, int)
        for room in plan.rooms:
            inside[room.window] += 1
            assert not plan.solid[room.window].any()
            assert min(room.extent(0), room.extent(1)) >= 15
        assert inside.max() == 1
        assert 0.5 < inside.mean() < 0.9
        assert len(plan.doors) >= len(plan.rooms)
        # Rooms are rooms: with all doors shut, each is a part of its own, and corridors are one more.
        shut = plan.solid.copy()
        for door in plan.doors:
            shut[door.window] = True
            assert sorted((door.extent(0), door.extent(1))) == [1, 9]
        assert ndimage.label(~shut)[1] == len(plan.rooms) + 1


def test_corridors_run_along_the_longer_side():
    plan = office_plan((240, 90), 0.1, np.random.default_rng(0))
    assert (~plan.solid).all(axis=0).sum() == 18  # 1.8 m, free from end to end
    turned = office_plan((90, 240), 0.1, np.random.default_rng(0))
    np.testing.assert_array_equal(turned.solid.T.shape, plan.solid.shape)
    assert (~turned.solid).all(axis=1).sum() == 18


def test_doors_have_lintels_and_rooms_furniture_in_3_d():
    for seed in range(10):
        occupied = office(OFFICE_3D.grid, np.random.default_rng(seed)).occupied
        plan = office_plan(OFFICE_3D.grid.shape[:2], 0.25, np.random.default_rng(seed))
        for door in plan.doors:
            assert not occupied[door.window][:, :, :9].any()
            assert occupied[door.window][:, :, 9:].all()
        pieces = occupied[:, :, 0] & ~plan.solid
        assert 0.03 < pieces.mean() < 0.15
        for room in plan.rooms:
            assert not occupied[room.window][:, :, 8:].any()  # nothing above 2 m
        world = World(OFFICE_3D.grid, occupied.copy(), "office")
        for layer in (1, 2, 3):  # ground robots at up to 1 m
            assert ndimage.label((world.collision_mask(0.3) == 0)[:, :, layer])[1] == 1


def test_2_d_offices_are_bare():
    for seed in range(3):
        plan = office_plan(OFFICE.grid.shape[:2], 0.1, np.random.default_rng(seed))
        occupied = office(OFFICE.grid, np.random.default_rng(seed)).occupied
        np.testing.assert_array_equal(occupied[:, :, 0], plan.solid)


def test_an_office_of_coarse_voxels_has_doors_that_a_body_passes():
    for seed in range(10):
        plan = office_plan((41, 33), 0.5, np.random.default_rng(seed))
        for door in plan.doors:
            assert sorted((door.extent(0), door.extent(1))) == [1, 3]
