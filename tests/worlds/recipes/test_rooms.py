"""The empty workspace and the furnished room."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import BOX, ROOM
from entropy_explore_env.worlds.recipes.rooms import empty, furnished

GRIDS = [ROOM.grid, BOX.grid, Grid((31, 17, 6), 0.25), Grid((40, 25, 1), 0.1)]


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: str(grid.shape))
def test_furnished_worlds_hang_together_and_stand_on_the_floor(grid):
    worlds = [furnished(grid, np.random.default_rng(seed)) for seed in range(8)]
    for world in worlds:
        occupied = world.occupied
        assert ndimage.label(~occupied)[1] == 1
        share = occupied[:, :, 0].mean()
        assert 0.08 <= share < 0.5
        if not grid.flat:
            assert (occupied[:, :, :-1] | ~occupied[:, :, 1:]).all()  # nothing hangs in the air
            assert not occupied[:, :, -1].any()
    assert len({world.occupied.tobytes() for world in worlds}) >= 7


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 1, 3), (2, 1, 1), (2, 2, 1), (3, 2, 2)])
def test_a_workspace_too_small_for_furniture_is_refused_or_furnished(shape):
    for seed in range(3):
        try:
            world = furnished(Grid(shape, 0.5), np.random.default_rng(seed))
        except WorldError as error:
            assert error.field == "Grid.shape"
        else:
            assert world.occupied.any()
            assert not world.occupied.all()


def test_an_empty_world_is_empty_and_draws_nothing():
    rng = np.random.default_rng(0)
    before = rng.bit_generator.state
    assert not empty(BOX.grid, rng).occupied.any()
    assert rng.bit_generator.state == before
