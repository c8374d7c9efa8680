"""Height maps by hand: ground, sky, ceiling, unknown samples, and every format that holds one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.proofs.world_samples import geotiff, heights, npz
from entropy_explore_env.errors import SettingError, WorldError, WorldWarning
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
    with pytest.raises(SettingError, match=r"ceiling_m = 0\.9: expected at least one voxel"):
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


GRID = "ncols 4\nnrows 3\nxllcorner 500\nyllcorner -10\ncellsize 2\nNODATA_value -1\n"


@pytest.mark.parametrize(
    "head",
    [
        GRID,
        GRID.upper().replace("\n", "\r\n"),
        GRID.replace("xllcorner 500", "xllcenter 501").replace("yllcorner -10", "yllcenter -9"),
        GRID.replace("cellsize 2", "dx 2\ndy 2"),
    ],
)
def test_esri_grids(tmp_path, head):
    """Rows from the north; layers of 2 m from -1 m on below the surfaces of 1 to 7 m, one column unknown."""
    path = tmp_path / "grid.asc"
    path.write_text(head + "1 3 5 7\n1 3 5 7\n1\t3 -1\n7\n")
    world = load_world(path)
    assert world.grid.origin_m == (500.0, -10.0, -1.0)
    assert world.grid.shape == (4, 3, 4 + 5)
    assert world.unknown is not None and world.unknown.any(axis=2).tolist() == [[False] * 3] * 2 + [
        [True, False, False],
        [False] * 3,
    ]
    assert world.occupied[:, 2].sum(axis=1).tolist() == [1, 2, 3, 4]


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


@pytest.mark.parametrize(
    ("text", "value"), [("-3.4028235e+38", -3.4028235e38), ("9999.9", 9999.9), ("nan", np.nan)]
)
def test_nodata_is_compared_in_the_rasters_type(tmp_path, text, value):
    samples = heights()
    samples[0, 0] = np.float32(value)
    (tmp_path / "hills.tif").write_bytes(geotiff(samples, tags=[(42113, "s", 0, text, True)]))
    world = load_world(tmp_path / "hills.tif")
    assert world.grid.shape[2] < 20
    assert world.unknown is not None and np.argwhere(world.unknown.any(axis=2)).tolist() == [[0, 10]]


@pytest.mark.parametrize(
    ("text", "kind"), [(" ", "f4"), ("nan", "i2"), ("-9999", "u2"), ("0.5", "u1"), ("-1e39", "u1")]
)
def test_nodata_that_the_raster_cannot_hold_is_none(tmp_path, text, kind):
    samples = np.round(heights()).astype(kind)
    samples[0, 0] = 0
    (tmp_path / "hills.tif").write_bytes(geotiff(samples, tags=[(42113, "s", 0, text, True)]))
    assert load_world(tmp_path / "hills.tif").unknown is None


def test_heights_that_are_none_are_named(tmp_path):
    samples = heights()
    samples[0, 0] = -3.4e38
    (tmp_path / "hills.tif").write_bytes(geotiff(samples))
    with pytest.raises(WorldError, match=r"along each axis; its heights are from -3.4e\+38 to .* m"):
        load_world(tmp_path / "hills.tif")


def keyed(*entries, **more):
    """A GeoTIFF of heights with these GeoKeys, (number, value) each."""
    numbers = [1, 1, 0, 1 + len(entries), 1024, 0, 1, 1]
    for key, value in entries:
        numbers += [key, 0, 1, value]
    return geotiff(heights(), directory=tuple(numbers), **more)


FOOT, SURVEY_FOOT = 0.3048, 1200 / 3937


@pytest.mark.parametrize(
    ("entries", "across_m", "up_m"),
    [
        ([(3076, 9001), (4099, 9001)], 1.0, 1.0),
        ([(3076, 9003)], SURVEY_FOOT, 1.0),
        ([(3076, 9002), (4099, 9002)], FOOT, FOOT),
        ([(4099, 9003)], 1.0, SURVEY_FOOT),
        ([(3076, 9036)], 1000.0, 1.0),
        ([(3072, 2263)], SURVEY_FOOT, 1.0),  # New York's plane, in feet; no key says so
        ([(3072, 32633)], 1.0, 1.0),
        ([(3072, 2263), (3076, 9001)], 1.0, 1.0),  # a unit that is stated counts
        ([(4096, 6360)], 1.0, SURVEY_FOOT),  # NAVD88 height in feet
        ([(3072, 32767)], 1.0, 1.0),
    ],
)
def test_feet_and_kilometres_become_metres(tmp_path, entries, across_m, up_m):
    path = tmp_path / "hills.tif"
    path.write_bytes(keyed(*entries))
    world = load_world(path)
    assert world.grid.voxel_size_m == pytest.approx(across_m)
    assert world.grid.origin_m[:2] == pytest.approx((100 * across_m, 189 * across_m))
    low = float(heights().min()) * up_m
    assert world.grid.origin_m[2] == pytest.approx(low - across_m)


def test_other_units_are_refused_by_name(tmp_path):
    path = tmp_path / "hills.tif"
    path.write_bytes(keyed((3076, 9005)))
    with pytest.raises(WorldError, match=r"ProjLinearUnits are metres, .* not EPSG 9005"):
        load_world(path)
    path.write_bytes(keyed((3072, 2)))
    with pytest.raises(WorldError, match=r"reference system is known, not EPSG 2"):
        load_world(path)


_ITEM = '<Item name="x" sample="0" role="{}">{}</Item>'
GDAL = f"<GDALMetadata>{_ITEM}{_ITEM}</GDALMetadata>"


def test_heights_are_scaled_and_offset_as_gdal_has_it(tmp_path):
    path = tmp_path / "hills.tif"
    counts = np.round(100 * (heights() - 10.0)).astype(np.int16)
    metadata = (42112, "s", 0, GDAL.format("scale", "0.01", "offset", "10"), True)
    path.write_bytes(geotiff(counts, tags=[metadata]))
    world = load_world(path)
    np.testing.assert_array_equal(world.occupied.sum(axis=2), expected(counts / 100 + 10.0, 1.0))
    feet = [(42112, "s", 0, GDAL.format("unittype", "ftUS", "z", ""), True)]
    for data in (geotiff(heights(), tags=feet), keyed((4096, 2), tags=feet)):  # no system needs to be known
        path.write_bytes(data)
        assert load_world(path).grid.origin_m[2] == pytest.approx(float(heights().min()) * SURVEY_FOOT - 1.0)
    path.write_bytes(
        geotiff(heights(), tags=[(42112, "s", 0, GDAL.format("unittype", "fathom", "z", ""), True)])
    )
    with pytest.raises(WorldError, match="not in fathom"):
        load_world(path)


def test_tags_of_place_count_without_a_directory_of_keys(tmp_path):
    path = tmp_path / "hills.tif"
    path.write_bytes(geotiff(heights(), directory=()))
    first = load_world(path)
    assert first.grid.origin_m[:2] == (100.0, 189.0)
    matrix = (1.0, 0, 0, 100.0, 0, -1.0, 0, 200.0, 0, 0, 0, 0, 0, 0, 0, 1.0)
    path.write_bytes(
        geotiff(heights(), directory=(), scale=(), tie=(), tags=[(34264, "d", 16, matrix, True)])
    )
    assert load_world(path).grid == first.grid
    turned = (0.8, 0.6, *matrix[2:4], 0.6, -0.8, *matrix[6:])
    path.write_bytes(
        geotiff(heights(), directory=(), scale=(), tie=(), tags=[(34264, "d", 16, turned, True)])
    )
    with pytest.raises(WorldError, match="north up"):
        load_world(path)


@pytest.mark.parametrize(
    "more", [{"compression": "lzw"}, {"compression": "lzw", "predictor": 3}, {"compression": "zstd"}]
)
def test_compressed_rasters_are_read(tmp_path, more):
    pytest.importorskip("imagecodecs")
    (tmp_path / "hills.tif").write_bytes(geotiff(heights(), **more))
    world = load_world(tmp_path / "hills.tif")
    np.testing.assert_array_equal(world.occupied.sum(axis=2), expected(heights(), 1.0))


def test_large_margins_without_heights_are_cropped_and_places_stay(tmp_path):
    samples = np.full((1000, 1100), np.nan, np.float32)
    samples[980:991, 500:507] = heights()
    (tmp_path / "hills.tif").write_bytes(geotiff(samples))
    with pytest.warns(WorldWarning, match="cropped from 1100 × 1000 to 9 × 13"):
        world = load_world(tmp_path / "hills.tif")
    assert world.grid.origin_m[:2] == (100.0 + 499, 200.0 - 992)
    np.testing.assert_array_equal(world.occupied[1:-1, 1:-1].sum(axis=2), expected(heights(), 1.0))


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
