"""Which file is read how: suffixes, settings, and files that change."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from benchmarks.proofs.world_samples import SAMPLES, npz, pgm, sketch
from entropy_explore_env import EntropyExploreEnv, EntropyExploreVectorEnv
from entropy_explore_env.envs.episodes import require_same, snapshot
from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.worlds.files.process import kept_reader
from entropy_explore_env.worlds.load import (
    load_octomap,
    load_world,
    save_world,
    world_from_file,
)
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import free_box


@pytest.mark.parametrize("loader", SAMPLES)
def test_every_kind_of_file_is_a_world(tmp_path, loader):
    with kept_reader():
        for sample in SAMPLES[loader]():
            for name, data in sample.files.items():
                (tmp_path / name).write_bytes(data)
            path = tmp_path / next(iter(sample.files))
            world = load_world(path, **sample.options)
            assert 0 < world.occupied.mean() < 1
            assert not world.occupied.flags.writeable
            loud = path.with_suffix(path.suffix.upper())
            path.rename(loud)
            np.testing.assert_array_equal(load_world(str(loud), **sample.options).occupied, world.occupied)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        *((name, r"\.bt \.ot \.yaml") for name in ("castle", "castle.docx", "castle.bt.zip", "")),
        ("plan.npy", r"convert it: .*World\(Grid\(a\.shape"),
        ("house.IFC", r"convert it: .*\.glb"),
        ("house.dxf", r"convert it: .*\.png"),
        ("scan.e57", r"convert it: .*pdal"),
    ],
)
def test_what_is_not_read_is_refused_with_what_is_or_what_converts_it(name, said):
    with pytest.raises(WorldError, match=said):
        load_world(name)


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("voxel_size_m", 0.0),
        ("voxel_size_m", "1"),
        ("height_m", -1.0),
        ("resolution_m", math.nan),
        ("ceiling_m", math.inf),
        ("clearance_m", 0),
        ("read_limit_s", True),
        ("negate", 1),
        ("fill", "no"),
    ],
)
def test_settings_out_of_range_are_refused_before_anything_is_read(setting, value):
    with pytest.raises(SettingError, match=rf"{setting} = .*: expected (a number > 0|True or False)"):
        load_world("nowhere.png", **{setting: value})


@pytest.mark.parametrize("load", [load_world, load_octomap])
def test_an_option_that_there_is_not_is_refused_with_the_one_that_is_like_it(load):
    with pytest.raises(SettingError, match=r"voxl_size_m = 0\.2: expected.*; did you mean voxel_size_m\?$"):
        load("nowhere.bt", voxl_size_m=0.2)


def test_settings_that_mean_nothing_for_a_file_are_refused(tmp_path):
    path = tmp_path / "plan.pgm"
    path.write_bytes(pgm(sketch()))
    with pytest.raises(SettingError, match=r"ceiling_m = 2\.0: expected None: it does not apply to PNG, PGM"):
        load_world(path, ceiling_m=2.0)
    hills = tmp_path / "hills.npz"
    hills.write_bytes(npz(elevation=np.arange(12.0).reshape(3, 4)))
    with pytest.raises(SettingError, match=r"height_m = 3\.0: expected None: the file's world is 3-D"):
        load_world(hills, resolution_m=1.0, height_m=3.0)


def test_a_scenario_takes_any_file_and_keeps_its_voxel_size(tmp_path):
    path = tmp_path / "plan.pgm"
    path.write_bytes(pgm(np.full((40, 60), 255, np.uint8)))  # 3 × 2 m
    scenario = Missions(free_box(world=str(path))).scenario
    assert scenario.grid.voxel_size_m == 0.5
    assert scenario.grid.shape == (6, 4, 1)
    assert world_from_file(path, 0.5) is world_from_file(path, 0.5)  # read once


def test_a_file_that_was_written_again_is_read_again(tmp_path):
    path = tmp_path / "plan.pgm"
    path.write_bytes(pgm(np.full((40, 60), 255, np.uint8)))
    first = world_from_file(path, 0.05)
    path.write_bytes(pgm(np.full((30, 60), 255, np.uint8)))
    assert (first.grid.shape, world_from_file(path, 0.05).grid.shape) == ((60, 40, 1), (60, 30, 1))
    text, plan = tmp_path / "plan.yaml", np.full((30, 60), 255, np.uint8)
    text.write_text(
        "image: plan.pgm\nresolution: 0.05\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    (tmp_path / "nowhere").symlink_to(tmp_path / "missing")
    plan[10:20, 30] = 0
    assert world_from_file(text, 0.05).occupied.sum() == 0
    path.write_bytes(pgm(plan))
    assert world_from_file(text, 0.05).occupied.sum() == 10


def test_a_link_to_a_file_of_another_name_is_read_by_its_own_name(tmp_path):
    (tmp_path / "0b1e").write_bytes(pgm(np.full((40, 60), 255, np.uint8)))
    (tmp_path / "plan.pgm").symlink_to(tmp_path / "0b1e")
    assert world_from_file(tmp_path / "plan.pgm", 0.05).grid.shape == (60, 40, 1)


def unknown_beyond(rows):
    """A plan of 60 × 40 pixels of 0.05 m, all free in its first rows and solid beyond: 1 voxel is 0.25 m."""
    plan = np.zeros((40, 60), np.uint8)
    plan[:rows] = 255
    return pgm(plan)


CHANGED = {
    "solid voxels": unknown_beyond(20),
    "shape": pgm(np.full((40, 70), 255, np.uint8)),
    "voxel count": pgm(np.full((80, 120), 255, np.uint8)),
    "no map": b"P5 nothing",
    "nothing": None,
}


@pytest.mark.parametrize("what", CHANGED)
def test_a_file_that_changes_under_an_environment_is_refused_by_name_and_changes_nothing(tmp_path, what):
    path = tmp_path / "plan.pgm"
    path.write_bytes(unknown_beyond(30))
    settings = {"world": str(path), "grid": Grid((7, 11, 5), 0.25), "robots": 2}
    single, several = EntropyExploreEnv(BOX, **settings), EntropyExploreVectorEnv(BOX, 3, **settings)
    envs = (single, several, pickle.loads(pickle.dumps(single)))
    for env in envs:
        env.reset(seed=1)
        walk(env)
    if CHANGED[what] is None:
        path.unlink()
    else:
        path.write_bytes(CHANGED[what])
    for env in envs:
        before = snapshot(env)
        with pytest.raises(WorldError) as raised:
            env.reset(seed=2)
        assert str(path) in str(raised.value)
        require_same("refused", before, snapshot(env))
        walk(env)  # the mission that is under way goes on
    if what in ("solid voxels", "shape", "voxel count"):
        fresh = EntropyExploreEnv(BOX, **settings)
        fresh.reset(seed=2)
        world, kept = fresh.missions.worlds[0], single.missions.worlds[0]
        assert world.grid != kept.grid or (world.occupied != kept.occupied).any()
    path.write_bytes(unknown_beyond(30))  # written again, the same
    for env in envs:
        env.reset(seed=2)
        walk(env)


@pytest.mark.parametrize("what", ["origin", "heading", "ceiling", "unreadable"])
def test_another_world_of_the_same_voxels_is_a_changed_file(tmp_path, what):
    """Files of the library's own say more of a world than which of its voxels are solid."""
    occupied = np.zeros((7, 11, 5), bool)
    occupied[2:4, 5:7] = True
    ceiling = np.full((7, 11), 4, np.int32)
    parts = {"ceiling": ceiling, "yaw_rad": 0.5, "unreadable": occupied}
    grid = Grid((7, 11, 5), 0.25)
    save_world(World(grid, occupied, "plan", **parts), tmp_path / "world.npz")
    env = EntropyExploreEnv(BOX, world=str(tmp_path / "world.npz"), grid=grid, robots=1)
    env.reset(seed=1)
    before = snapshot(env)
    less = occupied.copy()
    less[2, 5] = False
    other = {
        "origin": {},
        "heading": {"yaw_rad": 0.25},
        "ceiling": {"ceiling": ceiling - 1},
        "unreadable": {"unreadable": less},
    }[what]
    where = Grid((7, 11, 5), 0.25, (1.0, 0.0, 0.0)) if what == "origin" else grid
    save_world(World(where, occupied, "plan", **{**parts, **other}), tmp_path / "world.npz")
    with pytest.raises(WorldError, match="a file that stays as it was read"):
        env.reset(seed=2)
    require_same("refused", before, snapshot(env))


def walk(env):
    for _ in range(3):
        each = isinstance(env, EntropyExploreEnv)
        env.step({a: env.action_space(a).sample() for a in env.agents} if each else env.action_space.sample())


def test_a_path_may_be_a_text_and_begin_at_home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    solid = np.zeros((3, 4, 2), bool)
    solid[1, 2] = True
    world = World(Grid(solid.shape, 0.5), solid, "corner")
    save_world(world, "~/saved/corner.npz")
    assert [file.name for file in (tmp_path / "saved").iterdir()] == ["corner.npz"]
    again = load_world("~/saved/corner.npz")
    np.testing.assert_array_equal(again.occupied, solid)
    scenario = Missions(free_box(world="~/saved/corner.npz")).scenario
    assert scenario.grid.size_m.tolist() == [1.5, 2.0, 1.0]
    with pytest.raises(SettingError, match="below a home folder that exists"):
        load_world("~nobody-of-this-name/corner.npz")
