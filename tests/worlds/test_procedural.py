"""Worlds made from recipes, and which world a scenario asks for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from entropy_explore_env.config import Grid
from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.randomness import Stream, generator
from entropy_explore_env.scenarios import BOX, ROOM, ROOM_FURNISHED
from entropy_explore_env.worlds.load import make_world, with_world, world_from_file
from entropy_explore_env.worlds.procedural import empty, furnished
from tests.reference.scenes import free_box

GRIDS = [ROOM.grid, BOX.grid, Grid((31, 17, 6), 0.25), Grid((40, 25, 1), 0.1)]


def rng(seed):
    return generator(seed, 0, Stream.WORLD)


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: str(grid.shape))
def test_furnished_worlds_hang_together_and_stand_on_the_floor(grid):
    worlds = [furnished(grid, rng(seed)) for seed in range(8)]
    for world in worlds:
        occupied = world.occupied
        assert ndimage.label(~occupied)[1] == 1
        share = occupied[:, :, 0].mean()
        assert 0.08 <= share < 0.5
        if not grid.flat:
            assert (occupied[:, :, :-1] | ~occupied[:, :, 1:]).all()  # nothing hangs in the air
            assert not occupied[:, :, -1].any()
    assert len({world.occupied.tobytes() for world in worlds}) == 8


def test_the_same_seed_gives_the_same_world():
    first, second = (make_world(ROOM_FURNISHED, rng(5)) for _ in range(2))
    np.testing.assert_array_equal(first.occupied, second.occupied)
    assert first.grid == ROOM_FURNISHED.grid


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 1, 3), (2, 1, 1), (2, 2, 1), (3, 2, 2)])
def test_a_workspace_too_small_for_furniture_is_refused_or_furnished(shape):
    for seed in range(3):
        try:
            world = furnished(Grid(shape, 0.5), rng(seed))
        except WorldError as error:
            assert error.field == "Grid.shape"
        else:
            assert world.occupied.any()
            assert not world.occupied.all()


def test_an_empty_world_is_empty_and_shared():
    assert not empty(BOX.grid, rng(0)).occupied.any()
    assert make_world(BOX, rng(0)) is make_world(BOX, rng(1))
    assert make_world(BOX, rng(0)).grid == BOX.grid


@pytest.mark.parametrize("name", ["castle", "castle.docx", "", "octomap"])
def test_a_world_that_nobody_knows_is_refused(name):
    scenario = free_box(world=name)
    for ask in (lambda: make_world(scenario, rng(0)), lambda: with_world(scenario)):
        with pytest.raises(SettingError, match=r"Scenario\.world = .*empty, furnished.*\.bt"):
            ask()


def test_a_world_file_that_is_missing(tmp_path):
    path = tmp_path / "nowhere.bt"
    with pytest.raises(WorldError, match="allowed is a file that exists") as raised:
        world_from_file(path, 0.5)
    assert str(path) in str(raised.value)


def test_a_recipe_leaves_the_scenario_s_grid_alone():
    assert with_world(ROOM_FURNISHED) is ROOM_FURNISHED
