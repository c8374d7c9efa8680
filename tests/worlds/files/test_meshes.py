"""Meshes: boxes whose voxels are known, solid or hollow, in every format."""

from __future__ import annotations

import re

import numpy as np
import pytest

from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.worlds.files import meshes, process
from entropy_explore_env.worlds.files.voxels import Options
from entropy_explore_env.worlds.load import load_world
from tests.systems import needs_posix

trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")

BOXES = (((0, 0, 0), (2, 3, 1)), ((5, 1, 0), (6, 4, 4)))


def write(folder, kind, boxes=BOXES, upright=True):
    """Boxes; a GLB has y up, so what is z for us is its y, and its z points to -y."""
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in boxes])
    if kind == "glb" and upright:
        x, y, z = np.array(mesh.vertices).T
        mesh = trimesh.Trimesh(np.column_stack((x, z, -y)), mesh.faces)
    data = mesh.export(file_type="stl_ascii" if kind == "ascii.stl" else kind)
    path = folder / f"boxes.{kind}"
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


@pytest.mark.parametrize("kind", ["obj", "stl", "ascii.stl", "glb", "ply"])
@pytest.mark.parametrize("voxel_m", [0.5, 0.25])
def test_boxes_are_solid_where_they_are(tmp_path, kind, voxel_m):
    world = load_world(write(tmp_path, kind), voxel_m)
    solid = np.zeros((int(6 / voxel_m), int(4 / voxel_m), int(4 / voxel_m)), bool)
    for low, high in BOXES:
        solid[tuple(slice(int(a / voxel_m), int(b / voxel_m)) for a, b in zip(low, high, strict=True))] = True
    assert world.grid.origin_m == pytest.approx((0.0, 0.0, 0.0))
    np.testing.assert_array_equal(world.occupied, solid)


@pytest.mark.parametrize("unit_m", [1.0, 0.001, 0.3048])
@pytest.mark.parametrize("kind", ["stl", "obj", "glb"])
def test_walls_that_share_corners_with_a_floor_stay_as_thin_as_they_are(tmp_path, kind, unit_m):
    """A corner of two bodies has no normal of its own, and files in float32 round places between voxels."""
    boxes = np.array(
        [
            ((0, 0, 0), (7.3, 4.1, 0.1)),  # the floor
            ((0, 0, 0.1), (7.3, 0.1, 2.0)),  # two walls on it, which meet in a corner
            ((0, 0.1, 0.1), (0.1, 4.1, 2.0)),
        ]
    )
    path = write(tmp_path, kind, boxes / unit_m)
    world = load_world(path, 0.1, scale=unit_m, fill=False)
    solid = np.zeros((73, 41, 20), bool)
    solid[:, :, 0] = solid[:, 0, :] = solid[0, :, :] = True
    assert world.grid.origin_m == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    np.testing.assert_array_equal(world.occupied, solid)


@pytest.mark.parametrize("kind", ["obj", "stl", "glb", "ply"])
@pytest.mark.parametrize("voxel_m", [0.1, 0.23])
def test_long_thin_triangles_are_cut_small_enough(tmp_path, kind, voxel_m):
    """A column of 0.2 × 0.2 × 3 m beside a table: in each of its layers, and nowhere else, it is solid."""
    boxes = (((-4.8, 5.2, 1.2), (-3.8, 7.2, 1.8)), ((0.95, 3.15, -1.0), (1.15, 3.35, 2.0)))
    world = load_world(write(tmp_path, kind, boxes), voxel_m)
    for low, high in boxes:
        inside = np.mgrid[tuple(slice(a + 0.01, b - 0.005, 0.045) for a, b in zip(low, high, strict=True))]
        assert world.occupied[tuple(world.grid.voxel_of(inside.reshape(3, -1).T).T)].all()
    for place in ((-1.0, 4.0, 0.5), (-4.3, 6.2, 0.9), (1.05, 5.0, 1.5)):
        assert not world.occupied[tuple(world.grid.voxel_of(np.array(place)))]


def test_a_hollow_box_keeps_its_inside(tmp_path):
    path = write(tmp_path, "stl", [((0, 0, 0), (3.5, 5.5, 2.5))])
    with pytest.raises(
        WorldError, match=r"free space .* encloses all of it \(.*fill=False, --hollow; clearance_m"
    ):
        load_world(path, 0.5)
    with pytest.raises(WorldError, match=r"a map with free space at this voxel size$"):
        load_world(write(tmp_path, "obj", [((0, 0, 0), (0.5, 1.0, 0.5))]), 0.5)  # nothing is enclosed
    world = load_world(path, 0.5, fill=False)
    assert world.grid.shape == (7, 11, 5)
    assert not world.occupied[1:-1, 1:-1, 1:-1].any()
    assert (~world.occupied).sum() == 5 * 9 * 3


def test_clearance_is_free_space_around(tmp_path):
    world = load_world(write(tmp_path, "stl", [((0, 0, 0), (3.5, 5.5, 2.5))]), 0.5, clearance_m=0.7)
    assert world.grid.shape == (11, 15, 9)
    assert world.grid.origin_m == (-1.0, -1.0, -1.0)
    assert world.occupied[2:-2, 2:-2, 2:-2].all()
    assert world.occupied.sum() == 7 * 11 * 5


def test_settings_and_sizes(tmp_path):
    path = write(tmp_path, "obj")
    with pytest.raises(SettingError, match="voxel_size_m = None"):
        load_world(path)
    with pytest.raises(SettingError, match=r"ceiling_m = 1\.0: expected None: it does not apply to mesh"):
        load_world(path, 0.5, ceiling_m=1.0)
    with pytest.raises(WorldError, match="at most"):
        load_world(path, 1e-3)


@needs_posix
def test_what_lies_beside_an_obj_is_not_read(tmp_path):
    """A material library that is a pipe would be waited for."""
    import os

    path = write(tmp_path, "obj")
    os.mkfifo(tmp_path / "pipe.mtl")
    path.write_bytes(b"mtllib pipe.mtl\nmtllib /dev/zero\n" + path.read_bytes())
    assert load_world(path, 0.5).grid.shape == (12, 8, 8)


def test_a_file_without_faces_is_refused(tmp_path):
    path = tmp_path / "empty.obj"
    path.write_bytes(b"v 0 0 0\nv 1 0 0\n")
    with pytest.raises(WorldError, match=r"a (whole mesh|mesh with faces)"):
        load_world(path, 0.5)


def test_a_surface_in_parts_has_the_same_voxels(monkeypatch):
    """Also faces that are first cut into four, since they alone would be too many small triangles."""
    turned = trimesh.transformations.euler_matrix(0.3, 0.2, 0.5)
    parts = [trimesh.creation.box((3.0, 2.0, 1.0), turned), trimesh.creation.icosphere(2, 0.8)]
    whole = meshes._voxels(trimesh.util.concatenate(parts), Options({"voxel_size_m": 0.05}))
    monkeypatch.setattr(meshes, "_POINTS_AT_ONCE", 2000)
    monkeypatch.setattr(meshes, "_HALVINGS_AT_ONCE", 3)
    again = meshes._voxels(trimesh.util.concatenate(parts), Options({"voxel_size_m": 0.05}))
    np.testing.assert_array_equal(again.labels, whole.labels)
    assert again.origin_m == whole.origin_m and 0 < (whole.labels == 1).mean() < 1


def one_triangle(corners, voxel_m=1.0):
    """Its voxels, and the lower corner of the first one."""
    mesh = trimesh.Trimesh(corners, [[0, 1, 2]])
    voxels = meshes._voxels(mesh, Options({"voxel_size_m": voxel_m, "fill": False}))
    return voxels.labels == 1, np.round(np.array(voxels.origin_m) / voxel_m).astype(int)


@pytest.mark.parametrize("foot", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("across", [0.0, 2.7])
def test_the_voxels_of_a_needle_are_those_that_its_places_lie_in(foot, across):
    """200 m long, and up to 2.7 m wide: places drawn on it are in solid voxels, and no others are solid."""
    a, b = np.array([0.31, 0.4, 0.2]), np.array([190.3, 57.4, 21.7])
    c = a + foot * (b - a) + across * np.array([-0.28, 0.96, 0.0])
    assert meshes._are_thin(np.array([[a, b, c]])).all()
    solid, low = one_triangle(np.array([a, b, c]))
    shares = np.random.default_rng(0).dirichlet(np.ones(3), 4000)
    at = np.floor(shares @ np.array([a, b, c]) + 1e-6).astype(int) - low
    assert solid[tuple(at.T)].mean() > 0.97  # a place in a voxel's corner may be missed
    there = np.argwhere(solid) + low + 0.5
    along = (b - a) / np.linalg.norm(b - a)
    off = there - a - ((there - a) @ along)[:, None] * along
    assert np.linalg.norm(off, axis=1).max() < across + 0.5 * np.sqrt(3.0) + 1e-4


def test_a_needle_of_a_hundred_thousand_voxels_is_read_soon(tmp_path):
    """In a box of 100,000 × 3 × 2 voxels; cut into four each time, it would be 10¹⁰ small triangles."""
    path = tmp_path / "needle.obj"
    path.write_bytes(b"v 0.5 0.5 0.5\nv 99999.5 2.5 1.5\nv 60000 0.5 0.5\nf 1 2 3\n")
    with process.kept_reader() as reader:
        world = load_world(path, 1.0, fill=False)
        assert reader.cost is not None and reader.cost["peak_kib"] < 300 * 1024
    assert world.grid.shape == (100_000, 3, 2)
    assert world.occupied.any(axis=(1, 2)).all()


def test_faces_that_are_there_twice_are_drawn_once(monkeypatch):
    drawn = []
    kept = meshes._divided
    monkeypatch.setattr(meshes, "_divided", lambda corners: drawn.append(len(corners)) or kept(corners))
    box = trimesh.creation.box((3.0, 2.0, 1.0))
    for faces in (box.faces, np.concatenate([box.faces, box.faces[::-1], np.roll(box.faces, 1, axis=1)])):
        mesh = trimesh.Trimesh(box.vertices, faces, process=False)
        meshes._voxels(mesh, Options({"voxel_size_m": 0.25, "fill": False}))
    assert drawn == [12, 12]


def room(inverted=False):
    """A hall of 4 × 3 × 2 m drawn by its inner walls."""
    trimesh = pytest.importorskip("trimesh")
    shell = trimesh.creation.box(bounds=[[1, 2, 0], [5, 5, 2]])
    if inverted:
        shell.invert()
    return shell


@pytest.mark.parametrize("inverted", [False, True])
def test_a_building_drawn_by_its_inner_walls_is_free_inside(tmp_path, inverted):
    path = tmp_path / "hall.stl"
    path.write_bytes(room(inverted).export(file_type="stl"))
    world = load_world(path, 0.5, inside=True)
    assert world.grid.shape == (10, 8, 6) and world.grid.origin_m == (0.5, 1.5, -0.5)
    free = ~world.occupied
    assert free.sum() == 8 * 6 * 4 and free[1:-1, 1:-1, 1:-1].all()
    with pytest.raises(SettingError, match=r"inside = True: .* fill"):
        load_world(path, 0.5, inside=True, fill=False)


def test_an_open_building_encloses_nothing(tmp_path):
    shell = room()
    shell.update_faces(shell.face_normals[:, 2] < 0.5)  # without its ceiling
    (tmp_path / "hall.stl").write_bytes(shell.export(file_type="stl"))
    with pytest.raises(WorldError, match="encloses space at this voxel size"):
        load_world(tmp_path / "hall.stl", 0.5, inside=True)


def test_units_and_the_upright_axis_of_a_mesh(tmp_path):
    """The hall in millimetres with y up: its height is along the file's y."""
    shell = room()
    shell.vertices = 1000.0 * shell.vertices[:, [0, 2, 1]] * [1, 1, -1]
    path = tmp_path / "hall.stl"
    path.write_bytes(shell.export(file_type="stl"))
    world = load_world(path, 0.5, inside=True, scale=0.001, up="y")
    assert world.grid.shape == (10, 8, 6) and world.grid.origin_m == (0.5, 1.5, -0.5)
    with pytest.raises(WorldError, match=r"the box is 4,000 × 2,000 × 3,000 m: is it in millimetres\?"):
        load_world(path, 0.05)


@pytest.mark.parametrize(("unit", "up", "factor"), [("0.01", "Z", 100.0), ("1", "Y", 1.0), (None, None, 1.0)])
def test_a_dae_states_its_unit_and_its_axis(tmp_path, unit, up, factor):
    pytest.importorskip("collada")
    shell = room()
    shell.vertices *= factor
    if up != "Z":
        shell.vertices = shell.vertices[:, [0, 2, 1]] * [1, 1, -1]
    data = shell.export(file_type="dae")
    asset = re.search(rb"<asset>.*?</asset>", data, re.DOTALL)
    assert asset is not None
    about = "" if unit is None else f'<unit name="x" meter="{unit}"/>'
    about += "" if up is None else f"<up_axis>{up}_UP</up_axis>"
    new = b"<asset><created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified>"
    data = data.replace(asset[0], new + about.encode() + b"</asset>")
    (tmp_path / "hall.dae").write_bytes(data)
    world = load_world(tmp_path / "hall.dae", 0.5, inside=True)
    assert world.grid.shape == (10, 8, 6) and world.grid.origin_m == (0.5, 1.5, -0.5)
