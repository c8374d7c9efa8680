"""Pictures of worlds: what is solid is where it belongs, with a scale in metres."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.pictures import (
    _FREE,
    _SOLID,
    _UNKNOWN,
    _UNREADABLE,
    _metres,
    _stretch,
    picture,
)
from entropy_explore_env.worlds.world import World


def drawn(occupied, edge=0.5, origin=(10.0, -20.0, 3.0), name="hall"):
    data = picture(World(Grid(occupied.shape, edge, origin), occupied, name))
    image = Image.open(io.BytesIO(data))
    assert image.format == "PNG"
    return np.asarray(image.convert("RGB")).astype(int)


def is_colour(pixels, colour):
    return (np.abs(pixels - np.array(colour)) <= 2).all(axis=-1)


def test_a_plan_has_x_to_the_right_and_y_up():
    occupied = np.zeros((7, 11, 1), bool)
    occupied[6, 0] = True  # lower right
    pixels = drawn(occupied)
    rows, columns = np.nonzero(is_colour(pixels, _SOLID))
    free_rows, free_columns = np.nonzero(is_colour(pixels, _FREE))
    edge = 880 / 11
    assert len(rows) == pytest.approx(edge * edge, rel=0.05)
    assert columns.min() == pytest.approx(free_columns.max() - edge, abs=3)
    assert rows.max() == pytest.approx(free_rows.max(), abs=3)
    assert rows.min() == pytest.approx(free_rows.max() - edge, abs=3)


@pytest.mark.parametrize("roofed", [False, True])
def test_a_3_d_world_is_drawn_from_above_and_from_the_side(roofed):
    occupied = np.zeros((7, 11, 5), bool)
    occupied[2, 3, :3] = True
    occupied[:, :, 4] |= roofed
    tall = drawn(occupied)
    without = drawn(np.zeros((7, 11, 5), bool) | (occupied & (np.arange(5) == 4)))
    assert tall.shape == without.shape
    assert tall.shape[0] > 880 + 880 * 5 / 11
    changed = np.nonzero((tall != without).any(axis=-1))
    # the same columns in both views: x = 2 of 7, at 80 pixels a voxel
    assert (changed[1].min() >= 0) and changed[0].max() > 64 + 880


def test_long_names_and_sizes_from_a_millimetre_to_a_hundred_kilometres_fit():
    occupied = np.zeros((13, 4, 3), bool)
    for edge in (1e-3, 0.05, 7.0, 8000.0):
        pixels = drawn(occupied, edge, name="a very long name of a world " * 8)
        assert pixels.shape[1] <= 1008
        assert is_colour(pixels[:, -4:], (255, 255, 255)).all()  # nothing runs over the edge


def test_lengths_are_not_said_more_exactly_than_anybody_reads():
    lengths = {0.05: "0.05", 0.08333: "0.0833", 0.0: "0", 38.96: "38.96", 74.4012: "74.4", -20.0: "-20"}
    lengths |= {999.96: "1000", 1339.22: "1339", 29983.67: "29984", 12.0: "12"}
    assert [_metres(length) for length in lengths] == list(lengths.values())


def test_low_worlds_are_stretched():
    assert [_stretch(height) for height in (880.0, 60.0, 59.0, 6.0)] == [1, 1, 2, 10]


def test_unknown_space_is_told_from_walls_and_empty_margins_are_cut_off():
    """A room of 3 × 4 with walls in a plan of 20 × 30, all else unknown."""
    occupied = np.ones((20, 30, 1), bool)
    occupied[5:8, 10:14] = False
    unknown = np.ones((20, 30, 1), bool)
    unknown[4:9, 9:15] = False
    world = World(Grid(occupied.shape, 0.5), occupied, "room", unknown=unknown)
    pixels = np.asarray(Image.open(io.BytesIO(picture(world))).convert("RGB")).astype(int)
    inside = pixels[64 : 64 + 880, 64:-70]
    room, walls, blue = (is_colour(inside, colour).sum() for colour in (_FREE, _SOLID, _UNKNOWN))
    assert room / walls == pytest.approx(12 / 18, rel=0.05) and blue == 0  # cut to 5 × 6 voxels
    unknown[4, 9] = True
    world = World(Grid(occupied.shape, 0.5), occupied, "room", unknown=unknown)
    pixels = np.asarray(Image.open(io.BytesIO(picture(world))).convert("RGB")).astype(int)
    corner = is_colour(pixels[64 : 64 + 880], _UNKNOWN)
    rows, columns = np.nonzero(corner)
    assert len(rows) == pytest.approx((880 / 6) ** 2, rel=0.05)
    assert rows.min() > 600 and columns.max() < 64 + 160  # lower left


def test_a_3_d_world_shows_what_is_unknown_from_above_and_from_the_side():
    occupied = np.ones((7, 11, 5), bool)
    occupied[1:6, 2:9, 1:4] = False
    unknown = occupied.copy()
    unknown[0:7, 1:10, 0:5] = False  # walls, floor and ceiling around the room
    unknown[5:, 8:] = occupied[5:, 8:]
    world = World(Grid(occupied.shape, 0.5), occupied, "room", unknown=unknown)
    pixels = np.asarray(Image.open(io.BytesIO(picture(world))).convert("RGB")).astype(int)
    assert is_colour(pixels, _UNKNOWN).sum() > 2000 and is_colour(pixels, _SOLID).sum() > 2000
    plain = World(Grid(occupied.shape, 0.5), occupied, "room")
    without = np.asarray(Image.open(io.BytesIO(picture(plain))).convert("RGB")).astype(int)
    assert is_colour(without, _UNKNOWN).sum() == 0


def test_rock_without_free_space_is_cut_off():
    occupied = np.ones((40, 60, 1), bool)
    occupied[10:20, 20:40] = False
    pixels = drawn(occupied)
    assert is_colour(pixels, _FREE).sum() > 0.7 * is_colour(pixels, _SOLID).sum()
    assert is_colour(pixels, _FREE).sum() / 880**2 == pytest.approx(200 / 22**2, rel=0.05)


def test_surfaces_without_return_are_red_in_plans_and_where_they_are_the_top_of_the_ground():
    occupied = np.ones((7, 11, 1), bool)
    occupied[1:6, 1:10] = False
    glass = np.zeros((7, 11, 1), bool)
    glass[0, 2:5] = True
    plan = World(Grid(occupied.shape, 0.5), occupied, "room", unreadable=glass)
    pixels = np.asarray(Image.open(io.BytesIO(picture(plan))).convert("RGB")).astype(int)
    assert is_colour(pixels, _UNREADABLE).sum() == pytest.approx(3 * (880 / 11) ** 2, rel=0.05)
    ground = np.zeros((7, 11, 5), bool)
    ground[:, :, :2] = True
    sand = np.zeros((7, 11, 5), bool)
    sand[2, 3:5, 1] = sand[5, 5, 0] = True  # the last is below the ground
    terrain = World(Grid(ground.shape, 0.5), ground, "ground", unreadable=sand)
    pixels = np.asarray(Image.open(io.BytesIO(picture(terrain))).convert("RGB")).astype(int)
    assert is_colour(pixels, _UNREADABLE).sum() == pytest.approx(2 * (880 / 11) ** 2, rel=0.05)
