"""Terrain: solid ground, an exposure surface above it everywhere, room for a robot between."""

from __future__ import annotations

import numpy as np
import pytest

from entropy_explore_env.errors import WorldError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import TERRAIN
from entropy_explore_env.worlds.recipes.terrain import exposure_surface, terrain
from tests.reference.scenes import wander

GRIDS = [TERRAIN.grid, Grid((31, 47, 29), 0.3), Grid((13, 9, 11), 2.0), Grid((81, 63, 80), 0.1)]


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: str(grid.shape))
def test_the_ceiling_is_above_the_ground_with_room_for_a_robot_between(grid):
    for seed in range(12):
        world = terrain(grid, np.random.default_rng(seed))
        ground = world.occupied.sum(axis=2)
        np.testing.assert_array_equal(world.occupied, np.arange(grid.shape[2]) < ground[:, :, None])
        assert ground.min() >= 1
        assert world.ceiling.dtype == np.int32 and world.ceiling.max() <= grid.shape[2]
        gaps_m = (world.ceiling - ground) * grid.voxel_size_m
        assert gaps_m.min() >= min(4.0, 2 * 0.3)
        assert gaps_m.min() >= 4.0 - grid.voxel_size_m
        places = (world.collision_mask(0.3) == 0).any(axis=2)
        margin = 0 if grid.voxel_size_m >= 0.6 else int(np.ceil(0.3 / grid.voxel_size_m - 0.5 - 1e-9))
        inner = places[margin : grid.shape[0] - margin, margin : grid.shape[1] - margin]
        assert inner.all(), f"columns without room: {(~inner).sum()}"


def test_the_relief_is_a_quarter_of_the_shorter_side_or_what_fits():
    for grid, relief in ((Grid((40, 30, 60), 1.0), 7.5), (Grid((90, 70, 14), 1.0), 9.0)):
        for seed in range(5):
            ground = terrain(grid, np.random.default_rng(seed)).occupied.sum(axis=2)
            assert ground.min() == 1
            assert ground.max() == pytest.approx(1 + relief, abs=0.5)


def test_the_exposure_surface_follows_the_ground_and_lets_robots_over_a_cliff():
    ground = np.ones((40, 30), np.int32)
    ground[20:] = 9
    surface = exposure_surface(ground, 20, 4, 1.0)
    assert (surface[:5] == 5).all() and (surface[-5:] == 13).all()
    assert (np.diff(surface, axis=0) >= 0).all()
    assert surface[19].min() >= 13  # beside the cliff, as high as above it
    assert exposure_surface(ground, 11, 4, 1.0).max() == 11


def test_robots_stay_below_the_exposure_surface():
    missions = Missions(TERRAIN, 1)
    missions.reset(0, seed=1)
    world = missions.worlds[0]
    assert world is not None and world.ceiling is not None
    occupied, ceiling = world.occupied, world.ceiling
    edge_m = TERRAIN.grid.voxel_size_m

    def check(step):
        for pose in missions.state.robots[0]["scan_pose"]:
            x, y, z = TERRAIN.grid.voxel_of(pose[:3])
            assert occupied[x, y].sum() <= z < ceiling[x, y], f"step {step}"
            assert pose[2] < ceiling[x, y] * edge_m

    check(-1)
    wander(missions, 25, 0, check)


@pytest.mark.parametrize("shape", [(30, 20, 1), (30, 20, 5), (5, 30, 20), (30, 5, 20)])
def test_flat_low_or_narrow_grids_are_refused(shape):
    with pytest.raises(WorldError, match=r"Grid\.shape = .*3-D, at least 6 × 6 m and 6 m high"):
        terrain(Grid(shape, 1.0), np.random.default_rng(0))
