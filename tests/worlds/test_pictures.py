"""Pictures of worlds: what is solid is where it belongs."""

from __future__ import annotations

import io
import sys
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from entropy_explore_env.errors import MissingExtraError
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

Figure = pytest.importorskip("matplotlib.figure").Figure


def drawn(occupied, edge=0.5, origin=(10.0, -20.0, 3.0), name="hall", **masks):
    """The pixels of a world's picture."""
    image = Image.open(
        io.BytesIO(picture(World(Grid(occupied.shape, edge, origin), occupied, name, **masks)))
    )
    assert image.format == "PNG"
    return np.asarray(image.convert("RGB")).astype(int)


def places(pixels, colour):
    """Rows and columns of the pixels of a colour."""
    return np.nonzero((np.abs(pixels - np.array(colour)) <= 2).all(axis=-1))


def count(pixels, colour):
    return len(places(pixels, colour)[0])


def test_a_plan_has_x_to_the_right_and_y_up():
    occupied = np.zeros((7, 11, 1), bool)
    occupied[6, 0] = True  # lower right
    pixels = drawn(occupied)
    (rows, columns), (free_rows, free_columns) = places(pixels, _SOLID), places(pixels, _FREE)
    edge = np.ptp(free_columns) / 7
    assert edge > 60.0
    assert columns.min() == pytest.approx(free_columns.max() - edge, abs=4)
    assert rows.max() == pytest.approx(free_rows.max(), abs=4)
    assert rows.min() == pytest.approx(free_rows.max() - edge, abs=4)


@pytest.mark.parametrize("roofed", [False, True])
def test_a_3_d_world_is_drawn_from_above_and_from_the_side(roofed):
    occupied = np.zeros((7, 11, 5), bool)
    occupied[2, 3, :3] = True
    occupied[:, :, 4] |= roofed
    tall, without = drawn(occupied), drawn(occupied & (np.arange(5) == 4))
    changed = np.nonzero((tall != without).any(axis=-1))[0]
    middle = len(tall) * 11 / 16  # between the views, eleven and five voxels high
    assert (changed > middle + 40).any() and (changed < middle - 40).any()


def test_long_names_and_sizes_from_a_millimetre_to_a_hundred_kilometres_fit():
    occupied = np.zeros((13, 4, 3), bool)
    for edge in (1e-3, 0.05, 7.0, 8000.0):
        pixels = drawn(occupied, edge, name="a very long name of a world " * 8)
        assert pixels.shape[1] <= 1008
        assert (pixels[:, -2:] == 255).all()  # nothing runs over the edge


@pytest.mark.parametrize("shape", [(40, 400, 1), (400, 40, 1), (12, 9, 5)])
def test_ticks_in_utm_coordinates_are_whole_and_apart(monkeypatch, shape):
    drawn_figures = []
    save = Figure.savefig
    monkeypatch.setattr(
        Figure, "savefig", lambda self, *a, **k: (drawn_figures.append(self), save(self, *a, **k))
    )
    drawn(np.zeros(shape, bool), 0.1, (431_000.35, 5_411_000.7, 0.0))
    for ax in drawn_figures[0].axes:
        low, high = ax.get_xlim()
        shown = [tick for tick in ax.get_xticklabels() if low <= tick.get_position()[0] <= high]
        assert shown and all(
            tick.get_text().startswith("43100" if shape[0] < 100 else "4310") for tick in shown
        )
        boxes = [tick.get_window_extent() for tick in shown]
        assert all(left.x1 < right.x0 for left, right in pairwise(boxes))
        assert not ax.xaxis.get_offset_text().get_text() and not ax.yaxis.get_offset_text().get_text()


def test_lengths_are_not_said_more_exactly_than_anybody_reads():
    lengths = {0.05: "0.05", 0.08333: "0.0833", 0.0: "0", 38.96: "38.96", 74.4012: "74.4", -20.0: "-20"}
    lengths |= {999.96: "1000", 1339.22: "1339", 29983.67: "29984", 12.0: "12"}
    assert [_metres(length) for length in lengths] == list(lengths.values())


def test_low_worlds_are_stretched():
    assert [_stretch(Grid((1000, 300, high), 0.1)) for high in (400, 69, 68, 7)] == [1, 1, 2, 10]


def test_unknown_space_is_told_from_walls_and_empty_margins_are_cut_off():
    """A room of 3 × 4 with walls in a plan of 20 × 30, all else unknown."""
    occupied = np.ones((20, 30, 1), bool)
    occupied[5:8, 10:14] = False
    unknown = np.ones((20, 30, 1), bool)
    unknown[4:9, 9:15] = False
    pixels = drawn(occupied, unknown=unknown)
    assert count(pixels, _FREE) / count(pixels, _SOLID) == pytest.approx(12 / 18, rel=0.1)  # cut to 5 × 6
    unknown[4, 9] = True
    pixels = drawn(occupied, unknown=unknown)
    rows, columns = places(pixels[:-50], _UNKNOWN)  # the key lies below
    free = places(pixels, _FREE)
    assert len(rows) == pytest.approx(count(pixels, _FREE) / 12, rel=0.1)
    assert rows.min() > free[0].max() - 250 and columns.max() < free[1].min() + 5  # lower left


def test_a_3_d_world_shows_what_is_unknown_from_above_and_from_the_side():
    occupied = np.ones((7, 11, 5), bool)
    occupied[1:6, 2:9, 1:4] = False
    unknown = occupied.copy()
    unknown[0:7, 1:10, 0:5] = False  # walls, floor and ceiling around the room
    unknown[5:, 8:] = occupied[5:, 8:]
    pixels = drawn(occupied, unknown=unknown)
    assert count(pixels, _UNKNOWN) > 2000 and count(pixels, _SOLID) > 2000
    assert count(drawn(occupied), _UNKNOWN) == 0


def test_rock_without_free_space_is_cut_off():
    occupied = np.ones((40, 60, 1), bool)
    occupied[10:20, 20:40] = False
    pixels = drawn(occupied)
    assert count(pixels, _FREE) / count(pixels, _SOLID) == pytest.approx(200 / 64, rel=0.1)


def test_surfaces_without_return_are_red_in_plans_and_where_they_are_the_top_of_the_ground():
    occupied, glass = np.ones((7, 11, 1), bool), np.zeros((7, 11, 1), bool)
    occupied[1:6, 1:10] = False
    glass[0, 2:5] = True
    pixels = drawn(occupied, unreadable=glass)
    assert count(pixels, _UNREADABLE) / count(pixels, _FREE) == pytest.approx(3 / 45, rel=0.1)
    ground, sand = np.zeros((7, 11, 5), bool), np.zeros((7, 11, 5), bool)
    ground[:, :, :2] = True
    sand[2, 3:5, 1] = sand[5, 5, 0] = True  # the last is below the ground
    one = count(pixels, _FREE) / 45
    assert count(drawn(ground, unreadable=sand), _UNREADABLE) == pytest.approx(2 * one, rel=0.15)


def test_a_missing_package_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingExtraError, match=r"\[baselines\]"):
        drawn(np.zeros((3, 3, 1), bool))
