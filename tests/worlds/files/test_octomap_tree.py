"""OctoMaps: small ones of known voxels, broken files."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.proofs.world_samples import octomap_bytes
from entropy_explore_env.command import READ_MEMORY_VARIABLE, allow_read_memory
from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.worlds.files import octomap_tree
from entropy_explore_env.worlds.files.process import kept_reader
from entropy_explore_env.worlds.files.resampling import resampled
from entropy_explore_env.worlds.files.voxels import Voxels
from entropy_explore_env.worlds.load import load_octomap, load_world
from tests.worlds.trees import building, write_tree

octomap = pytest.importorskip("octomap", reason="octomap-python is not installed")

UNKNOWN, FREE, SOLID = -1, 0, 1
SHAPE = (7, 11, 5)
EDGE_M = 0.2
LOW = np.array([-4, 3, -2])
"""Lower corner of the written voxels, in voxels from the map's origin."""


def write(path, labels, edge_m=EDGE_M, low=LOW):
    """An OctoMap of voxels (X, Y, Z), -1, 0 or 1, whose lower corner is at `low` voxels."""
    tree = octomap.OcTree(edge_m)
    for voxel in np.argwhere(labels != UNKNOWN):
        tree.updateNode((voxel + low + 0.5) * edge_m, bool(labels[tuple(voxel)] == SOLID))
    tree.updateInnerOccupancy()
    assert tree.writeBinary(str(path).encode())
    return path


def some_labels(seed=0):
    """Mostly free; some solid, some unknown; the corners known, so that the box is the whole."""
    labels = np.random.default_rng(seed).choice([FREE, FREE, FREE, SOLID, UNKNOWN], SHAPE)
    labels[0, 0, 0] = labels[-1, -1, -1] = SOLID
    labels[2:6, 2:6, 0:4] = FREE  # whole branches of the tree, stored as one
    return labels


def test_known_voxels_are_where_they_were_put(tmp_path):
    labels = some_labels()
    world = load_octomap(write(tmp_path / "room.bt", labels))
    assert world.grid.shape == SHAPE
    assert world.grid.voxel_size_m == pytest.approx(EDGE_M)
    assert world.grid.origin_m == pytest.approx(tuple(LOW * EDGE_M))
    np.testing.assert_array_equal(world.occupied, labels != FREE)  # unknown counts as solid
    assert world.name == "room"
    same = load_octomap(tmp_path / "room.bt", EDGE_M)
    np.testing.assert_array_equal(same.occupied, world.occupied)


@pytest.mark.parametrize("parts", [1, 2, 3, 4, 5])
def test_resampled_voxels_are_free_if_half_is_free_and_less_than_a_quarter_solid(tmp_path, parts):
    """New voxels `parts` halves of an old one wide, judged by counting eighths of old voxels."""
    labels = some_labels(parts)
    world = load_octomap(write(tmp_path / "room.bt", labels), parts * EDGE_M / 2)
    fine = labels.repeat(2, 0).repeat(2, 1).repeat(2, 2)
    fine = np.pad(fine, [(0, -n % parts) for n in fine.shape], constant_values=UNKNOWN)
    shape = tuple(n // parts for n in fine.shape)
    assert world.grid.shape == shape
    assert world.grid.origin_m == pytest.approx(tuple(LOW * EDGE_M))
    for voxel in np.ndindex(*shape):
        block = fine[tuple(slice(i * parts, (i + 1) * parts) for i in voxel)]
        free = (block == FREE).mean() >= 0.5 and (block == SOLID).mean() < 0.25
        assert world.occupied[voxel] == (not free), voxel


@pytest.mark.parametrize("share", [0.5, 0.7, 1.5, 2.0, 2.9, 4.0, 11.3])
def test_leaves_are_summed_up_as_the_whole_grid_would_be_resampled(tmp_path, share):
    labels = building((61, 45, 19), seed=int(10 * share), rooms=4, speckle=0.05)
    path = write_tree(tmp_path / "house.bt", labels, EDGE_M, (-20, 3, -7))
    assert np.array_equal(load_octomap(path).occupied, labels != FREE)
    world = load_octomap(path, share * EDGE_M)
    whole, _ = resampled(Voxels(labels, EDGE_M), share * EDGE_M)
    np.testing.assert_array_equal(world.occupied, whole != FREE)
    np.testing.assert_array_equal(world.unknown, whole == UNKNOWN)
    assert world.grid.origin_m == pytest.approx((-20 * EDGE_M, 3 * EDGE_M, -7 * EDGE_M))


def check_large(path, shape, edge_m, rooms, wanted_m, most_mib):
    """A building of this many nodes is read with the usual limits, and within so much memory."""
    speckle = 0.02
    write_tree(path, building(shape, 1, rooms, speckle), edge_m, (-300, -200, -10))
    with kept_reader() as reader:
        for voxel_m in wanted_m:
            world = load_octomap(path, voxel_m)
            extent = np.array(shape) * edge_m
            assert np.abs(world.grid.size_m - extent).max() < (voxel_m or edge_m)
            assert 0.1 < 1.0 - world.occupied.mean() < 0.9
        assert reader.cost is not None and reader.cost["peak_kib"] < most_mib * 1024
    return path.stat().st_size


def test_a_tree_with_a_large_box_is_read_at_a_size_that_fits(tmp_path):
    """Its own grid has 132 million nodes, more than any world may have; it is never made."""
    labels = np.full((1200, 1100, 100), UNKNOWN, np.int8)
    labels[100:900:4, 100, 50] = labels[0, 0, 0] = labels[-1, -1, -1] = SOLID
    labels[200:280, 300:364, 20:64] = FREE
    path = write_tree(tmp_path / "campus.bt", labels, 0.05, (-600, -100, -3))
    del labels
    assert "of its 132000000 voxels; a larger voxel_size_m has fewer" in refused(path).allowed
    with kept_reader() as reader:
        world = load_octomap(path, 0.4)
        assert reader.cost is not None and reader.cost["peak_kib"] < 200 * 1024
    assert world.grid.shape == (150, 138, 13)
    np.testing.assert_array_equal(np.argwhere(~world.occupied).min(axis=0), [25, 37, 2])
    np.testing.assert_array_equal(np.argwhere(~world.occupied).max(axis=0), [34, 45, 7])


@pytest.mark.long
def test_trees_of_large_buildings_are_read_with_the_usual_limits(tmp_path):
    size = check_large(tmp_path / "floor.bt", (874, 364, 65), 0.05, 30, (None, 0.1, 0.2, 0.25), 700)
    assert 0.7e6 < size < 2.1e6
    size = check_large(tmp_path / "campus.bt", (1460, 836, 140), 0.2, 12, (0.4, 0.8, 1.0), 1800)
    assert size > 2.1e6


def test_what_takes_too_much_memory_says_which_option_allows_more(tmp_path, monkeypatch):
    path = write_tree(tmp_path / "house.bt", building((180, 160, 80), 1, 6, 0.2), EDGE_M, (0, 0, 0))
    for load in (load_octomap, load_world):
        with pytest.raises(
            WorldError, match=r"within 1 MiB of memory \(read_memory_mib, --read-memory-mib, allows more"
        ):
            load(path, read_memory_mib=1.0)
    monkeypatch.setenv(READ_MEMORY_VARIABLE, "400")
    allow_read_memory(None)
    assert load_octomap(path).grid.shape == (180, 160, 80)
    allow_read_memory(1)
    with pytest.raises(WorldError, match="within 1 MiB"):
        load_octomap(path)
    assert load_octomap(path, read_memory_mib=400).grid.shape == (180, 160, 80)
    monkeypatch.setenv(READ_MEMORY_VARIABLE, "much")
    with pytest.raises(SettingError, match=f"{READ_MEMORY_VARIABLE} = 'much'"):
        load_octomap(path)
    for wrong in (0, -1.0, math.nan, math.inf):
        with pytest.raises(SettingError, match="read_memory_mib"):
            allow_read_memory(wrong)


def refused(path, voxel_size_m=None):
    """The one line that a file is refused with."""
    with pytest.raises(WorldError) as raised:
        load_octomap(path, voxel_size_m)
    error = raised.value
    assert error.field in ("world file", "voxel_size_m")
    assert error.allowed
    assert "\n" not in str(error)
    assert str(error) == f"{error.field} = {error.value!r}: expected {error.allowed}"
    return error


def full_tree(masks, size=None, res=b"0.1"):
    """An `.ot` of free nodes, depth first, from the children of each."""
    nodes = b"".join(np.float32(-1.0).tobytes() + bytes([mask]) for mask in masks)
    size = len(masks) if size is None else size
    return b"# Octomap OcTree file\nid OcTree\nsize %d\nres %s\ndata\n" % (size, res) + nodes


HOSTILE = {
    "children that never come": (full_tree([255] * 60), "a whole OctoMap tree"),
    "a node too few": (full_tree([3, 0]), "a whole OctoMap tree"),
    "bytes moved by one": (
        full_tree([1] * 16 + [0]).replace(b"data\n", b"data\n\x01"),
        "a whole OctoMap tree",
    ),
    "a level too many": (full_tree([1] * 17 + [0]), "a whole OctoMap tree"),
    "a size that is not its": (full_tree([3, 0, 0], 4), "as many nodes as its head says; there are 3"),
    "another tree": (full_tree([0]).replace(b"OcTree\nsize", b"CountingOcTree\nsize"), "whose id is OcTree"),
    "a size that is no number": (full_tree([0]).replace(b"size 1", b"size 1x"), "size and res are numbers"),
    "no resolution": (full_tree([0], res=b"0"), "a resolution > 0"),
    "binary, a level too many": (
        b"# Octomap OcTree binary file\nid OcTree\nsize 18\nres 0.1\ndata\n" + b"\x03\0" * 16 + b"\x01\0",
        "a whole OctoMap tree",
    ),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_trees_are_refused_at_once(tmp_path, kind):
    """octomap itself would make nodes of them until there is no memory left."""
    data, allowed = HOSTILE[kind]
    path = tmp_path / ("map.bt" if b"binary" in data else "map.ot")
    path.write_bytes(data)
    with kept_reader() as reader:
        assert allowed in refused(path).allowed
        assert reader.cost is not None and reader.cost["peak_kib"] < 200 * 1024


@pytest.mark.parametrize("binary", [True, False])
def test_a_tree_of_all_levels_is_read(tmp_path, binary):
    """One voxel at the deepest level, below sixteen nodes."""
    tree = octomap.OcTree(0.25)
    tree.updateNode(np.array([0.1, 0.1, 0.1]), False)
    path = tmp_path / ("map.bt" if binary else "map.ot")
    assert (tree.writeBinary if binary else tree.write)(str(path).encode())
    assert load_octomap(path).grid.shape == (1, 1, 1)
    body = path.read_bytes().partition(b"\ndata\n")[2]
    leaves, nodes = octomap_tree.leaves_of(body + b"more", binary)
    assert (nodes, leaves.width.tolist(), leaves.solid.tolist()) == (17, [1], [False])


def with_colours(data):
    """The full tree with a colour after each node's occupancy, as ColorOcTree writes it."""
    head, _, body = data.partition(b"\ndata\n")
    nodes = np.frombuffer(body, np.uint8).reshape(-1, 5)
    colours = np.full((len(nodes), 3), 200, np.uint8)
    body = np.concatenate([nodes[:, :4], colours, nodes[:, 4:]], axis=1).tobytes()
    return head.replace(b"id OcTree", b"id ColorOcTree") + b"\ndata\n" + body


@pytest.mark.parametrize(
    ("suffix", "change"),
    [
        (".bt", lambda data: data.replace(b"id OcTree", b"id ColorOcTree")),
        (".bt", lambda data: data.replace(b"id OcTree", b"id OcTreeStamped")),
        (".bt", lambda data: data.replace(b"id OcTree", b"id 1")),
        (".bt", lambda data: b"\r\n".join(data.split(b"\n", 5))),
        (".ot", lambda data: data.replace(b"id OcTree", b"id OcTreeStamped")),
        (".ot", with_colours),
    ],
)
def test_trees_of_other_kinds_have_the_same_occupancy(tmp_path, suffix, change):
    data = octomap_bytes(suffix)
    (tmp_path / f"plain{suffix}").write_bytes(data)
    (tmp_path / f"other{suffix}").write_bytes(change(data))
    first, other = (load_world(tmp_path / f"{name}{suffix}") for name in ("plain", "other"))
    assert first.grid == other.grid
    np.testing.assert_array_equal(first.occupied, other.occupied)
    np.testing.assert_array_equal(first.unknown, other.unknown)


def test_missing_files_and_folders_are_refused(tmp_path):
    assert refused(tmp_path / "nowhere.bt").allowed == "a file that exists"
    assert refused(tmp_path).allowed == "a file that exists"


def test_voxels_so_small_that_there_are_too_many_are_refused(tmp_path):
    error = refused(write(tmp_path / "room.bt", some_labels()), 1e-4)
    assert error.allowed.endswith("of its 3080000000000 voxels; a larger voxel_size_m has fewer")


def test_a_map_without_free_space_is_refused(tmp_path):
    path = write(tmp_path / "solid.bt", np.full(SHAPE, SOLID))
    assert "free space" in refused(path).allowed
    assert "free space" in refused(path, 0.3).allowed
