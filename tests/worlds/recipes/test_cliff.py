"""The cliff: a plateau that carries the rover, an edge that is not convex, rocks of sizes found on Mars."""

from __future__ import annotations

import math

import numpy as np
import pytest

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import CLIFF
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.worlds.recipes.cliff import PLATEAU_M, cliff
from entropy_explore_env.worlds.recipes.rocks import VIKING_2, RockSizes, draw_diameters, raise_rocks
from entropy_explore_env.worlds.world import Collision

GRIDS = [CLIFF.grid, Grid((31, 47, 20), 0.3), Grid((23, 17, 9), 0.5)]


def heights(world):
    """(X, Y) height of the ground in metres, of a world of columns."""
    ground = world.occupied.sum(axis=2)
    np.testing.assert_array_equal(world.occupied, np.arange(world.grid.shape[2]) < ground[:, :, None])
    return ground * world.grid.voxel_size_m


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: str(grid.shape))
def test_a_level_plateau_ends_in_a_drop_to_lower_ground(grid):
    for seed in range(8):
        ground = heights(cliff(grid, np.random.default_rng(seed)))
        plateau = np.isclose(ground, PLATEAU_M, atol=0.5 * grid.voxel_size_m)
        assert (
            ground.max() == ground[0, 0] and (ground[~plateau] <= PLATEAU_M - 0.5 + grid.voxel_size_m).all()
        )
        widths = plateau.sum(axis=0)
        np.testing.assert_array_equal(plateau, np.arange(grid.shape[0])[:, None] < widths)
        assert 0.2 * grid.shape[0] < widths.min() and widths.max() < 0.6 * grid.shape[0]


def test_the_edge_turns_in_and_out():
    """The middle of the polygon's chords lies beyond the edge somewhere, and on the plateau elsewhere."""
    for seed in range(8):
        ground = heights(cliff(CLIFF.grid, np.random.default_rng(seed)))
        widths = (ground == ground.max()).sum(axis=0).astype(float)
        chords = 0.5 * (widths[:-16] + widths[16:]) - widths[8:-8]
        assert chords.max() > 1.0 and chords.min() < -1.0


def test_a_band_at_one_end_is_smooth_and_unreadable_and_both_ends_occur():
    ends = set()
    for seed in range(12):
        world = cliff(CLIFF.grid, np.random.default_rng(seed))
        dark = world.unreadable.any(axis=2)
        rows = np.flatnonzero(dark.any(axis=0))
        assert len(rows) == round(0.3 * 96) and (rows[0] == 0 or rows[-1] == 95)
        assert np.ptp(heights(world)[dark]) == 0.0
        assert not dark[heights(world) == PLATEAU_M].any()
        np.testing.assert_array_equal(world.unreadable, world.occupied & dark[:, :, None])
        ends.add(bool(rows[0] == 0))
    assert ends == {True, False}


def test_rocks_cover_what_was_found_at_the_second_viking_site():
    """Cumulative area by diameter against F_k(D), Golombek & Rapp 1997, where they are numerous."""
    assert VIKING_2 == 0.176
    sizes, area_m2 = RockSizes(VIKING_2, 0.1, 1.5), 2e5
    drawn = draw_diameters(sizes, area_m2, np.random.default_rng(0))
    assert (np.diff(drawn) <= 0.0).all() and drawn.min() >= 0.1 and drawn.max() <= 1.5
    areas = 0.25 * math.pi * drawn**2
    for least_m in (0.1, 0.2, 0.4, 0.8):
        shares = (0.176 * math.exp(-(1.79 + 0.152 / 0.176) * edge_m) for edge_m in (least_m, 1.5))
        expected = next(shares) - next(shares)
        assert areas[drawn >= least_m].sum() / area_m2 == pytest.approx(expected, rel=0.03)


def test_a_rock_is_half_as_high_as_wide_and_rests_on_the_one_below():
    ground = np.full((21, 13), 0.5)
    raise_rocks(ground, np.array([1.0]), np.array([[1.05, 0.65]]), 0.1)
    assert ground[10, 6] == pytest.approx(1.0)
    assert ground[10 + 4, 6] == pytest.approx(0.5 + 0.3)  # 3-4-5
    assert (ground > 0.5).sum() == 69  # column centres nearer than 5 columns
    raise_rocks(ground, np.array([0.6]), np.array([[1.05, 0.65]]), 0.1)
    assert ground[10, 6] == pytest.approx(1.3)


def test_the_rover_stands_on_the_plateau_and_nowhere_else():
    world = make_world(CLIFF, 3)
    layout = world.layout(CLIFF)
    layer = CLIFF.layer_of(CLIFF.robot)
    assert layer is not None and CLIFF.ground_layer_of(CLIFF.robot) == round(PLATEAU_M / 0.125) - 1
    plane = layout.collision_mask[:, :, layer]
    plateau = heights(world) == PLATEAU_M
    inside = np.zeros(plateau.shape, bool)
    inside[2:-2, 2:-2] = True
    assert (plane[~plateau & inside] == Collision.EDGE).all()
    for x, y, _ in np.argwhere(layout.collision_mask[:, :, layer : layer + 1] == Collision.NONE):
        assert plateau[x - 2 : x + 3, y - 2 : y + 3].all()  # 0.3 m around it
    assert {int(v) % CLIFF.grid.shape[2] for v in layout.starts} == {layer}


@pytest.mark.parametrize(
    ("shape", "edge_m", "field"),
    [((80, 60, 35), 0.125, "Grid.shape"), ((20, 16, 12), 0.51, "Grid.voxel_size_m")],
)
def test_low_and_coarse_grids_are_refused(shape, edge_m, field):
    with pytest.raises(WorldError) as raised:
        cliff(Grid(shape, edge_m), np.random.default_rng(0))
    assert raised.value.field == field
