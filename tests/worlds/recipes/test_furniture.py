"""Furniture stands on the floor, in its room, and leaves ways at every height."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.furniture import LABORATORY, OFFICE, Piece, furnish
from entropy_explore_env.worlds.recipes.plan import Rectangle, bare_plan
from entropy_explore_env.worlds.world import World

ROOM = Rectangle((3, 5), (58, 47))
SHAPE = (61, 51, 23)


def furnished_room(seed, kinds=OFFICE, area_m2=2.0):
    plan = bare_plan(SHAPE, 0.1)
    plan.clear[3:12, 20:29] = True
    occupied = np.zeros(SHAPE, bool)
    furnish(occupied, plan, ROOM, kinds, area_m2, np.random.default_rng(seed))
    return plan, occupied


def test_pieces_stand_in_the_room_on_the_floor_and_out_of_the_way():
    counts = []
    for seed in range(20):
        plan, occupied = furnished_room(seed)
        outside = occupied.copy()
        outside[ROOM.window] = False
        assert not outside.any()
        assert not occupied[plan.clear].any()
        assert (occupied[:, :, :-1] | ~occupied[:, :, 1:]).all()
        assert not occupied[:, :, -1].any()
        counts.append(ndimage.label(occupied)[1])
        assert set(np.unique(occupied.sum(axis=2))) <= {0, 8, 18, 20}  # 0.75, 1.8 and 2 m
    assert min(counts) >= 3 and max(counts) <= 12  # one for 2 m² of 23.1, where there is room


def test_every_layer_of_a_furnished_room_is_connected_for_bodies():
    for seed in range(15):
        for kinds in (OFFICE, LABORATORY):
            _, occupied = furnished_room(seed, kinds)
            walled = np.ones(SHAPE, bool)
            walled[ROOM.window] = occupied[ROOM.window]
            world = World(Grid(SHAPE, 0.1), walled, "room")
            for body_m in (0.2, 0.3):
                room = world.collision_mask(body_m) == 0
                layers = [ndimage.label(room[:, :, z])[1] for z in range(SHAPE[2])]
                assert max(layers) == 1, (seed, body_m, layers)


def test_a_piece_against_a_wall_is_against_a_wall():
    shelf = Piece(1.5, 0.4, 2.0, True)
    for seed in range(10):
        _, occupied = furnished_room(seed, (shelf,))
        numbers, count = ndimage.label(occupied[:, :, 0])
        assert count >= 2
        for box in ndimage.find_objects(numbers):
            assert box[0].start == 3 or box[0].stop == 58 or box[1].start == 5 or box[1].stop == 47


def test_a_room_too_small_for_its_furniture_stays_bare():
    plan, occupied = bare_plan((7, 11), 0.1), np.zeros((7, 11, 9), bool)
    furnish(occupied, plan, plan.whole, OFFICE, 0.01, np.random.default_rng(0))
    assert not occupied.any()
