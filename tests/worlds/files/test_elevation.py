"""Height maps by hand: ground, sky, ceiling, unknown samples, and every format that holds one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.proofs.world_samples import geotiff, heights, npz
from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.worlds.files.elevation import columns, degrees_as_metres
from entropy_explore_env.worlds.files.voxels import Options
from entropy_explore_env.worlds.load import load_world

HILLS = np.array([[0.0, 0.4, 0.6], [2.0, 3.0, 1.0]])
"""(X, Y) metres; with voxels of 1 m the floor is at -1 m and voxel centres at -0.5, 0.5, 1.5, 2.5 m."""
GROUND = [[1, 1, 2], [3, 4, 2]]


def test_a_voxel_is_solid_if_its_centre_lies_below_the_surface():
    voxels = columns(HILLS, (1.0, 1.0), Options({"clearance_m": 2.0}), (10.0, 20.0))
    assert voxels.labels.shape == (2, 3, 6)
    assert (voxels.labels == 1).sum(axis=2).tolist() == GROUND
    assert (np.diff((voxels.labels == 1).astype(int), axis=2) <= 0).all()  # columns from below
    assert (voxels.voxel_size_m, voxels.origin_m, voxels.ceiling) == (1.0, (10.0, 20.0, -1.0), None)


def test_five_voxels_of_sky_if_nothing_else_is_said():
    assert columns(HILLS, (1.0, 1.0), Options({})).labels.shape == (2, 3, 4 + 5)


def test_the_ceiling_follows_the_ground():
    """2 m above it: first closed layers are those whose centres lie at it or above."""
    voxels = columns(HILLS, (1.0, 1.0), Options({"ceiling_m": 2.0}))
    assert voxels.labels.shape == (2, 3, 7)
    assert voxels.ceiling is not None and voxels.ceiling.dtype == np.int32
    assert voxels.ceiling.tolist() == [[3, 3, 4], [5, 6, 4]]
    with pytest.raises(SettingError, match=r"ceiling_m = 0\.9: allowed is at least one voxel"):
        columns(HILLS, (1.0, 1.0), Options({"ceiling_m": 0.9}))


def test_columns_that_meet_an_unknown_sample_are_unknown():
    hills = HILLS.copy()
    hills[0, 0], hills[1, 2] = np.nan, np.inf
    voxels = columns(hills, (1.0, 1.0), Options({}))
    assert (voxels.labels[0, 0] == -1).all() and (voxels.labels[1, 2] == -1).all()
    assert (voxels.labels == -1).sum() == 2 * voxels.labels.shape[2]


def test_a_column_is_as_high_as_the_highest_sample_that_it_meets():
    """Samples of 1 × 2 m as voxels of 1.5 m: along x each meets both, along y 0, 0-1, 1-2 and 2."""
    voxels = columns(HILLS, (1.0, 2.0), Options({"voxel_size_m": 1.5, "clearance_m": 1.5}))
    assert voxels.labels.shape[:2] == (2, 4)
    tops = [[2.0, 3.0, 3.0, 1.0], [2.0, 3.0, 3.0, 1.0]]
    ground = [[math.ceil((top + 1.5) / 1.5 - 0.5) for top in row] for row in tops]
    assert (voxels.labels == 1).sum(axis=2).tolist() == ground
    fine = columns(HILLS, (1.0, 1.0), Options({"voxel_size_m": 0.5})).labels
    assert fine.shape[:2] == (4, 6)
    np.testing.assert_array_equal(fine[::2, ::2], fine[1::2, 1::2])


def test_degrees_are_metres_of_a_sphere():
    x, y = degrees_as_metres(1.0, 1.0, 60.0)
    assert y == pytest.approx(111_195.08, abs=0.1)
    assert x == pytest.approx(y / 2)


def expected(samples, voxel_m):
    """Ground layers (X, Y) of samples (rows from the north, columns), one voxel each."""
    upright = samples[::-1].T.astype(np.float64)
    return np.ceil((upright - upright.min() + voxel_m) / voxel_m - 0.5 - 1e-9)


def test_npz_by_name_by_spacing_and_by_default(tmp_path):
    path = tmp_path / "hills.npz"
    path.write_bytes(npz(elevation=heights(), other=np.zeros((2, 2)), spacing_m=np.float64(0.5)))
    world = load_world(path)
    assert world.grid.voxel_size_m == 0.5
    np.testing.assert_array_equal(world.occupied.sum(axis=2), expected(heights(), 0.5))
    path.write_bytes(npz(anything=heights()))
    np.testing.assert_array_equal(load_world(path, resolution_m=0.5).occupied, world.occupied)
    with pytest.raises(SettingError, match="resolution_m = None"):
        load_world(path)
    path.write_bytes(npz(one=heights(), two=heights()))
    with pytest.raises(WorldError, match="elevation"):
        load_world(path, resolution_m=0.5)


@pytest.mark.parametrize("more", [{}, {"compression": "zlib"}])
def test_geotiff_says_where_it_lies(tmp_path, more):
    path = tmp_path / "hills.TIFF"
    path.write_bytes(geotiff(heights(), **more))  # the upper left corner at (100, 200)
    world = load_world(path, ceiling_m=3.0)
    assert world.grid.origin_m[:2] == (100.0, 189.0)
    np.testing.assert_array_equal(world.occupied.sum(axis=2), expected(heights(), 1.0))
    assert (world.ceiling >= world.occupied.sum(axis=2) + 3).all()
    with pytest.raises(SettingError, match="resolution_m"):
        load_world(path, resolution_m=2.0)  # it says so itself


def test_geotiff_without_data_in_places_and_in_degrees(tmp_path):
    path, samples = tmp_path / "hills.tif", heights()
    samples[0, 0] = -9999.0
    nodata = (42113, "s", 0, "-9999", True)
    path.write_bytes(geotiff(samples, tags=[nodata]))
    world = load_world(path)
    assert world.occupied[0, -1].all()  # unknown is solid
    assert world.occupied.sum(axis=2)[1:].max() < world.grid.shape[2]
    degrees = geotiff(heights(), scale=(0.001, 0.001, 0.0), tie=(0, 0, 0, 8.0, 60.0055, 0), model=2)
    path.write_bytes(degrees)
    world = load_world(path, 60.0)
    assert world.grid.origin_m[:2] == (0.0, 0.0)
    assert world.grid.shape[:2] == (math.ceil(7 * 55.6 / 60.0), math.ceil(11 * 111.2 / 60.0))
    path.write_bytes(b"".join(degrees[i : i + 1] for i in range(len(degrees) // 2)))
    with pytest.raises(WorldError):
        load_world(path)


def test_jacksboro():
    """344 × 403 samples of 3″ at 36.6° north: 30.0 × 31.9 km, 236 to 1076 m."""
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    world = load_world("jacksboro", 200.0, ceiling_m=400.0)
    assert world.grid.size_m[:2] == pytest.approx([30000, 31900], rel=0.01)
    assert world.grid.origin_m == (0.0, 0.0, 36.0)
    ground = world.occupied.sum(axis=2)
    assert (ground.min(), ground.max()) == (1, math.ceil((1076 - 36) / 200 - 0.5))
    np.testing.assert_array_equal(np.unique(world.ceiling - ground), [2])
    assert world.name == "jacksboro"
