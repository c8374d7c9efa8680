"""Worlds saved and loaded without loss; archives that lie."""

from __future__ import annotations

import io
import math
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.proofs.world_samples import npz, saved_world
from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.load import load_world, save_world, world_from_bytes
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import SHAPES, drawn, random_cover, seeds

finite = st.floats(-1e6, 1e6)


@drawn(30)
@given(
    seeds,
    st.sampled_from(SHAPES),
    st.floats(1e-3, 1e3),
    st.tuples(finite, finite, finite),
    st.floats(-math.pi, math.pi),
    st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters="\0"), min_size=1, max_size=20),
    st.booleans(),
)
def test_a_saved_world_comes_back_without_loss(
    tmp_path_factory, seed, shape, edge, origin, yaw, name, roofed
):
    occupied = random_cover(shape, 0.4, seed) > 0.5
    occupied.flat[0] = False
    ceiling = None
    if roofed:
        ceiling = np.random.default_rng(seed).integers(0, shape[2] + 1, shape[:2]).astype(np.int32)
    world = World(Grid(shape, edge, origin), occupied, name, ceiling, yaw)
    path = tmp_path_factory.mktemp("worlds") / "any.npz"
    save_world(world, path)
    for same in (load_world(path), world_from_bytes(path.read_bytes())):
        assert (same.grid, same.name, same.yaw_rad) == (world.grid, name, yaw)
        np.testing.assert_array_equal(same.occupied, occupied)
        assert (same.ceiling is None) == (ceiling is None)
        if ceiling is not None:
            np.testing.assert_array_equal(same.ceiling, ceiling)


def test_a_ceiling_is_resampled_to_the_lowest_whole_voxel(tmp_path):
    """Layers of 0.5 m as voxels of 1 m: 3 of 6 layers are 1.5 m, of which one voxel is whole."""
    ceiling = np.full((7, 11), 6, np.int32)
    ceiling[2, 4], ceiling[6, 10] = 3, 4
    save_world(
        World(Grid((7, 11, 6), 0.5), np.zeros((7, 11, 6), bool), "hall", ceiling), tmp_path / "hall.npz"
    )
    world = load_world(tmp_path / "hall.npz", 1.0)
    assert world.grid.shape == (4, 6, 3)
    lowered = np.full((4, 6), 3)
    lowered[1, 2], lowered[3, 5] = 1, 2
    np.testing.assert_array_equal(world.ceiling, lowered)


def changed(**entries):
    with np.load(io.BytesIO(saved_world())) as archive:
        kept = {name: archive[name] for name in archive.files}
    return npz(**{**kept, **entries})


@pytest.mark.parametrize(
    ("entries", "allowed"),
    [
        ({"version": 2}, "format version 1"),
        ({"format": "another world"}, "format version 1"),
        ({"shape": np.array([7, 11, 6])}, "a bit for each voxel"),
        ({"shape": np.array([10**6, 10**6, 10**6])}, "at most"),
        ({"shape": np.array([7, 11])}, "a whole NumPy archive"),
        ({"occupied": np.zeros(49, np.int8)}, "a bit for each voxel"),
        ({"ceiling": np.full((7, 11), 6, np.int32)}, "a ceiling for each column"),
        ({"ceiling": np.full((7, 11), -1, np.int32)}, "a ceiling for each column"),
        ({"voxel_size_m": 0.0}, "a voxel size > 0"),
        ({"origin_m": np.array([0.0, np.nan, 0.0])}, "a finite place"),
    ],
)
def test_what_a_saved_world_must_be(tmp_path, entries, allowed):
    path = tmp_path / "lab.npz"
    path.write_bytes(changed(**entries))
    with pytest.raises(WorldError, match=allowed):
        load_world(path)
    path.write_bytes(changed())
    assert load_world(path).grid.shape == (7, 11, 5)


class Pickled:
    def __reduce__(self):
        return exec, ("open('executed', 'w').close()",)


def test_pickles_bombs_and_lying_headers_are_refused_unread(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "lab.npz"
    buffer = io.BytesIO()
    np.savez(buffer, elevation=np.array([[Pickled()]], object))
    path.write_bytes(buffer.getvalue())
    with pytest.raises(WorldError, match="each as large as its header says"):
        load_world(path, resolution_m=1.0)
    assert not (tmp_path / "executed").exists()
    text = b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999, 99999), }".ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("elevation.npy", b"\x93NUMPY\x01\x00v\x00" + text)
    with pytest.raises(WorldError, match="each as large as its header says"):
        load_world(path, resolution_m=1.0)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("a.npy", "w") as member:
        for _ in range(300):
            member.write(bytes(1 << 20))
    assert path.stat().st_size < 1 << 20
    with pytest.raises(WorldError, match="at most 32 arrays and 256 MiB"):
        load_world(path)


@pytest.mark.parametrize("name", ["unknown", "unreadable"])
def test_a_mask_of_some_solid_voxels_is_kept_and_a_contradicting_one_refused(tmp_path, name):
    occupied = np.random.default_rng(0).random((7, 11, 5)) < 0.5
    mask = occupied & (np.random.default_rng(1).random((7, 11, 5)) < 0.5)
    other = {"unknown": "unreadable", "unreadable": "unknown"}[name]
    world = World(Grid(occupied.shape, 0.5), occupied, "hall", **{name: mask})
    save_world(world, tmp_path / "hall.npz")
    again = load_world(tmp_path / "hall.npz")
    np.testing.assert_array_equal(getattr(again, name), mask)
    np.testing.assert_array_equal(again.occupied, occupied)
    assert getattr(again, other) is None
    coarse = load_world(tmp_path / "hall.npz", 1.0)
    assert coarse.unknown is not None and not (coarse.unknown & ~coarse.occupied).any()
    entries = dict(np.load(tmp_path / "hall.npz"))
    entries[name] = np.packbits(~occupied)
    np.savez(tmp_path / "wrong.npz", **entries)
    with pytest.raises(WorldError, match=f"{name} voxels count as solid"):
        load_world(tmp_path / "wrong.npz")
    for wrong in (~occupied, mask[:3], mask.astype(int), "x"):
        with pytest.raises(WorldError, match=rf"World\.{name}"):
            World(Grid(occupied.shape, 0.5), occupied, "hall", **{name: wrong})
    with pytest.raises(WorldError, match="no voxels that are unknown"):
        World(Grid(occupied.shape, 0.5), occupied, "hall", unknown=mask, unreadable=mask)


def test_resampled_voxels_are_unreadable_where_most_of_what_is_solid_in_them_is(tmp_path):
    occupied = np.zeros((4, 2, 2), bool)
    occupied[:2] = occupied[2, 0] = True
    unreadable = np.zeros((4, 2, 2), bool)
    unreadable[0] = unreadable[1, 0, 0] = unreadable[2, 0, 0] = True  # 5 of 8; 1 of 2
    save_world(World(Grid((4, 2, 2), 0.5), occupied, "x", unreadable=unreadable), tmp_path / "x.npz")
    with pytest.raises(WorldError, match="free space"):
        load_world(tmp_path / "x.npz", 1.0)
    occupied[2] = unreadable[2] = False
    save_world(World(Grid((4, 2, 2), 0.5), occupied, "x", unreadable=unreadable), tmp_path / "x.npz")
    coarse = load_world(tmp_path / "x.npz", 1.0)
    assert coarse.occupied.ravel().tolist() == [True, False]
    assert coarse.unreadable is not None and coarse.unreadable.ravel().tolist() == [True, False]
