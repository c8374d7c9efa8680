"""Point clouds in all encodings: the voxels that their points lie in."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.proofs.world_samples import pcd, ply, points
from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.worlds.files import point_clouds
from entropy_explore_env.worlds.files.voxels import Options
from entropy_explore_env.worlds.load import load_world


def expected(voxel_m):
    """Corner and voxels, counted point by point."""
    voxels = {tuple(np.floor(np.float64(p) / voxel_m).astype(int).tolist()) for p in points()}
    low = np.min(list(voxels), axis=0)
    return low * voxel_m, {tuple((np.array(v) - low).tolist()) for v in voxels}


@pytest.mark.parametrize(
    ("name", "data"),
    [(f"{each}.pcd", lambda each=each: pcd(each)) for each in ("ascii", "binary", "binary_compressed")]
    + [("binary.PLY", lambda: ply(True)), ("ascii.ply", lambda: ply(False))],
)
@pytest.mark.parametrize("voxel_m", [0.7, 1.3])
def test_a_voxel_is_solid_if_a_point_lies_in_it(tmp_path, name, data, voxel_m):
    (tmp_path / name).write_bytes(data())
    world = load_world(tmp_path / name, voxel_m)
    corner, voxels = expected(voxel_m)
    assert world.grid.origin_m == pytest.approx(tuple(corner))
    assert {tuple(v) for v in np.argwhere(world.occupied).tolist()} == voxels
    assert world.grid.voxel_size_m == voxel_m


def by_hand(*rows, count=None):
    head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
    number = len(rows) if count is None else count
    head += f"WIDTH {number}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {number}\nDATA ascii\n"
    return (head + "\n".join(rows) + "\n").encode()


def test_points_that_are_not_finite_are_none(tmp_path):
    path = tmp_path / "cloud.pcd"
    path.write_bytes(by_hand("-0.25 0.25 0.25", "nan nan nan", "2.75 1.25 0.75"))
    world = load_world(path, 0.5)
    assert world.grid.shape == (7, 3, 2)
    assert world.grid.origin_m == (-0.5, 0.0, 0.0)
    assert np.argwhere(world.occupied).tolist() == [[0, 0, 0], [6, 2, 1]]


def test_gaps_of_a_surface_are_closed_up_to_their_width(tmp_path):
    """Walls of points 0.4 m and 1 m apart, 2 m from each other: voxels of 0.2 m between the near points."""
    near, far = ([f"{x:.1f} {y:.1f} {z:.1f}" for y in axis for z in axis] for x, axis in WALLS)
    (tmp_path / "cloud.pcd").write_bytes(by_hand(*near, *far))
    open_, closed = (load_world(tmp_path / "cloud.pcd", 0.2, gap_m=gap_m).occupied for gap_m in (None, 0.4))
    assert [int(wall.sum()) for wall in (open_[0], open_[-1])] == [36, 9]
    assert closed[0].all() and int(closed[-1].sum()) == 9
    assert not closed[1:-1].any()
    with pytest.raises(SettingError, match=r"gap_m = -1.0: expected a number > 0"):
        load_world(tmp_path / "cloud.pcd", 0.2, gap_m=-1.0)


WALLS = ((0.1, np.arange(6) * 0.4 + 0.1), (2.1, np.arange(3) * 1.0 + 0.1))
"""x of a wall, and y and z of its points."""


def test_a_cloud_needs_a_voxel_size_that_gives_a_box_of_reason(tmp_path):
    path = tmp_path / "cloud.pcd"
    path.write_bytes(by_hand("0 0 0", "900 900 900"))
    with pytest.raises(SettingError, match="voxel_size_m = None"):
        load_world(path)
    with pytest.raises(WorldError, match="of its 5841725401 voxels; a larger voxel_size_m has fewer"):
        load_world(path, 0.5)
    path.write_bytes(by_hand("0 0 0", "1e30 0 0"))
    with pytest.raises(WorldError, match="along each axis"):
        load_world(path, 0.5)


@pytest.mark.parametrize("count", [0, 3, 10**6, 10**12, -1])
def test_a_header_that_promises_other_points_than_there_are_is_refused(tmp_path, count):
    path = tmp_path / "cloud.pcd"
    path.write_bytes(by_hand("0 0 0", "1 1 1", count=count))
    with pytest.raises(WorldError, match="as many points as its header says"):
        load_world(path, 0.5)


CUBE = ["0 0 0", "1.5 1 0.5", "1.6 0.2 0.9"]


def cloud_of(head, rows=CUBE, data="ascii", end="\n"):
    lines = [*head, f"WIDTH {len(rows)}", "HEIGHT 1", f"POINTS {len(rows)}", f"DATA {data}"]
    return end.join([*lines, *rows, ""]).encode()


XYZ = ["FIELDS x y z", "SIZE 4 4 4", "TYPE F F F"]


@pytest.mark.parametrize(
    "data",
    [
        cloud_of(["VERSION 0.7", *XYZ]),
        cloud_of(["VERSION .5", "COLUMNS x y z", *XYZ[1:], "COUNT 1 1 1"]),
        cloud_of([f"# {'x' * 6000}", "VERSION .6", *XYZ, "COUNT 1 1 1"]),
        cloud_of(["VERSION\t0.7", "FIELDS  x\ty z ", *XYZ[1:]], [r.replace(" ", "  ") + " \t" for r in CUBE]),
        cloud_of(["VERSION 0.7", *XYZ], end="\r\n"),
        cloud_of(
            ["FIELDS _ rgb y x z", "SIZE 1 4 8 8 8", "TYPE U F F F F", "COUNT 0 2 1 1 1"],
            [f"7 8 {y} {x} {z}" for x, y, z in (row.split() for row in CUBE)],
        ),
        cloud_of(["FIELDS X Y Z", *XYZ[1:]]),
    ],
)
def test_heads_of_every_age_are_read(tmp_path, data):
    """Voxels of 0.5 m: 4 × 3 × 2, the points in (0, 0, 0), (3, 2, 1) and (3, 0, 1)."""
    path = tmp_path / "cloud.pcd"
    path.write_bytes(data)
    world = load_world(path, 0.5)
    assert world.grid.shape == (4, 3, 2)
    assert np.argwhere(world.occupied).tolist() == [[0, 0, 0], [3, 0, 1], [3, 2, 1]]


def test_fields_of_no_bytes_are_skipped_in_binary_clouds(tmp_path):
    rows = np.array([tuple(map(float, row.split())) for row in CUBE])
    kinds = np.dtype([("i", "<u2", (3,)), ("z", "<f8"), ("x", "<f4"), ("y", "<f4")])
    some = np.zeros(3, kinds)
    some["x"], some["y"], some["z"] = rows.T
    head = ["FIELDS i _ z x y", "SIZE 2 1 8 4 4", "TYPE U U F F F", "COUNT 3 0 1 1 1"]
    path = tmp_path / "cloud.pcd"
    path.write_bytes(cloud_of(head, CUBE, "binary").split(CUBE[0].encode())[0] + some.tobytes())
    assert np.argwhere(load_world(path, 0.5).occupied).tolist() == [[0, 0, 0], [3, 0, 1], [3, 2, 1]]


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_laser_scans_are_read(tmp_path, suffix):
    """In UTM coordinates, stored as whole millimetres."""
    laspy = pytest.importorskip("laspy")
    las = laspy.create(point_format=3, file_version="1.4")
    las.header.offsets, las.header.scales = [500_000.0, 4_000_000.0, 0.0], [0.001] * 3
    las.x = np.array([500_000.25, 500_001.75])
    las.y = np.array([4_000_001.25, 4_000_000.25])
    las.z = np.array([0.25, 0.75])
    las.write(tmp_path / f"scan{suffix}")
    world = load_world(tmp_path / f"scan{suffix}", 0.5)
    assert world.grid.shape == (4, 3, 2)
    assert world.grid.origin_m == (500_000.0, 4_000_000.0, 0.0)
    assert np.argwhere(world.occupied).tolist() == [[0, 2, 0], [3, 0, 1]]


def test_units_and_axes_of_a_cloud(tmp_path):
    """Millimetres with y up: (x, y, z) is (x, -z, y)/1000 m."""
    path = tmp_path / "cloud.pcd"
    path.write_bytes(cloud_of(XYZ, ["250 250 -250", "1750 750 -1250"]))
    world = load_world(path, 0.5, scale=0.001, up="y")
    assert np.argwhere(world.occupied).tolist() == [[0, 0, 0], [3, 2, 1]]
    assert world.grid.origin_m == (0.0, 0.0, 0.0)
    with pytest.raises(WorldError, match=r"is it in millimetres\? scale=0\.001 \(--scale 0\.001\)"):
        load_world(path, 0.01)


def test_a_cloud_in_parts_has_the_same_voxels(monkeypatch):
    points_m = np.random.default_rng(0).normal(0.0, (1.0, 2.0, 0.5), (1000, 3))
    points_m[7] = np.nan
    whole = point_clouds.voxels_of(points_m, Options({"voxel_size_m": 0.2}))
    monkeypatch.setattr(point_clouds, "_POINTS_AT_ONCE", 64)
    again = point_clouds.voxels_of(points_m, Options({"voxel_size_m": 0.2}))
    np.testing.assert_array_equal(again.labels, whole.labels)
