"""Worlds given as objects: they bring their grid, are dealt in turn, and what is no world is refused."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.proofs.world_samples import pgm, sketch
from entropy_explore_env.errors import EntropyExploreError, SettingError, WorldError, WorldWarning
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.given import (
    GIVEN,
    distinct_names,
    distinct_paths,
    in_given_worlds,
    with_given_worlds,
)
from entropy_explore_env.worlds.load import load_world, save_world
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import free_box, wander

SHAPE = (9, 12, 7)
GRID = Grid(SHAPE, 0.4, (-1.0, 2.0, 0.5))


def walled(row: int, name: str = "walled", grid: Grid = GRID) -> World:
    """A box with a wall across it."""
    solid = np.zeros(grid.shape, bool)
    solid[row, 2:-2] = True
    return World(grid, solid, name)


WORLDS = tuple(walled(row, f"wall {row}") for row in (2, 4, 6))


def test_the_grid_is_the_world_s_and_all_else_the_scenario_s():
    scenario, given = with_given_worlds(
        free_box(robots=2), {"world": WORLDS[0], "split": "test", "robots": 3}
    )
    assert given == WORLDS[:1] and given[0] is WORLDS[0]
    assert (scenario.grid, scenario.world, scenario.robots, scenario.split) == (GRID, GIVEN, 3, "test")
    assert dataclasses.replace(scenario, grid=free_box().grid, world="empty") == free_box(
        robots=3, split="test"
    )
    assert GIVEN not in RECIPES


def test_recipes_and_files_stay_with_the_scenario(tmp_path):
    assert with_given_worlds(free_box(), {"world": "furnished"}) == (free_box(world="furnished"), ())
    assert with_given_worlds(free_box(), {"robots": 1}) == (free_box(robots=1), ())
    assert with_given_worlds(free_box(), {"world": tmp_path / "a.bt"})[0].world == str(tmp_path / "a.bt")


def test_a_scenario_that_fits_the_world_alone_is_taken():
    """The box is 2.5 m high: a sensor far above it fits the tower that is given."""
    tower = World(Grid((9, 12, 40), 0.5), np.zeros((9, 12, 40), bool), "tower")
    robot = {"motion": "planar", "sensor_height_m": 15.0}
    scenario = with_given_worlds(free_box(), {"world": tower, "robot": robot})[0]
    assert scenario.layer_of(scenario.robot) == 30
    with pytest.raises(SettingError, match="sensor_height_m"):
        with_given_worlds(free_box(), {"world": WORLDS[0], "robot": robot})


def test_missions_are_dealt_worlds_by_their_seeds_and_episodes():
    missions = Missions(free_box(robots=1), 4, given=WORLDS)
    missions.reset_some(range(4), [5, 6, 7, 8])
    assert [world.name for world in missions.worlds] == ["wall 6", "wall 2", "wall 4", "wall 6"]
    np.testing.assert_array_equal(
        missions.state.truth.reshape(4, *SHAPE), [world.occupied for world in missions.worlds]
    )
    missions.reset(1)
    missions.reset(2, 2**100)  # 2^100 = 1 mod 3
    assert [world.name for world in missions.worlds] == ["wall 6", "wall 4", "wall 4", "wall 6"]
    np.testing.assert_array_equal(missions.state.truth[1].reshape(SHAPE), WORLDS[1].occupied)


@pytest.mark.parametrize("split", ["train", "validation", "test"])
def test_a_given_world_is_the_same_mission_as_its_file_in_every_split(split, tmp_path):
    save_world(WORLDS[1], tmp_path / "world.npz")
    box = free_box(split=split, robots=2)
    scenario, given = with_given_worlds(box, {"world": WORLDS[1]})
    file = {"world": str(tmp_path / "world.npz"), "grid": {"voxel_size_m": 0.4}}
    missions = Missions(scenario, given=given), Missions(with_given_worlds(box, file)[0])
    for each in missions:
        each.reset(0, 3)
        wander(each, 15, 1)
    first, second = missions
    assert first.grid == second.grid
    for name, one, two in zip(first.state._fields, first.state, second.state, strict=True):
        assert one.tobytes() == two.tobytes(), name


def test_a_mapping_loads_a_file_with_its_options(tmp_path):
    (tmp_path / "plan.pgm").write_bytes(pgm(sketch()))
    asked = {"path": tmp_path / "plan.pgm", "negate": True, "resolution_m": 0.1, "height_m": 0.5}
    scenario, given = with_given_worlds(free_box(grid=Grid((4, 5, 3), 0.1)), {"world": asked})
    expected = load_world(tmp_path / "plan.pgm", 0.1, height_m=0.5, negate=True, resolution_m=0.1)
    assert scenario.grid == expected.grid and expected.grid.shape == (11, 7, 5)
    np.testing.assert_array_equal(given[0].occupied, expected.occupied)
    assert given[0].occupied.any() and not given[0].occupied.all()
    again = with_given_worlds(free_box(grid=Grid((4, 5, 3), 0.1)), {"world": asked})[1]
    assert again[0] is given[0]  # read once
    finer = with_given_worlds(free_box(), {"world": {**asked, "voxel_size_m": 0.05}})[0]
    assert finer.grid.shape == (22, 14, 10)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"world": 3}, "world = 3"),
        ({"world": []}, "a list of Worlds"),
        ({"world": [WORLDS[0], "office"]}, "a list of Worlds"),
        ({"world": [WORLDS[0], walled(2, grid=Grid(SHAPE, 0.5))]}, r"world\[1\]\.grid"),
        ({"world": [WORLDS[0], "nowhere.png"]}, r"nowhere\.png"),
        ({"world": WORLDS[0], "grid": {"voxel_size_m": 0.1}}, "brings its own"),
        ({"world": WORLDS[0], "robots": 0}, "Scenario.robots"),
        ({"world": {}}, "`path`"),
        ({"world": {"path": 3}}, "`path`"),
        ({"world": {"path": "nowhere.pgm"}}, "nowhere.pgm"),
        ({"world": {"path": "office"}}, "a recipe"),
        ({"world": {"path": "a.pgm", "wings": 2}}, "wings"),
        ({"world": {"path": "a.pgm", "height_m": [2.0]}}, "height_m"),
        ({"world": {"path": "a.pgm", "negate": "yes"}}, "negate"),
        ({"world": {"path": "a.pgm", "voxel_size_m": "fine"}}, "voxel_size_m"),
    ],
)
def test_what_is_no_world_is_refused_in_one_line(settings, said):
    with pytest.raises(EntropyExploreError, match=said) as caught:
        with_given_worlds(free_box(), settings)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 600


def test_plans_of_different_sizes_share_a_grid(tmp_path):
    for name, rows, columns in (("a", 20, 30), ("b", 40, 10)):
        (tmp_path / f"{name}.pgm").write_bytes(pgm(np.full((rows, columns), 255, np.uint8)))
    paths = [str(tmp_path / "a.pgm"), tmp_path / "b.pgm"]
    start = free_box(grid=Grid((4, 5, 1), 0.05))
    scenario, given = with_given_worlds(start, {"world": paths})
    assert scenario.grid.shape == (30, 40, 1) and [each.name for each in given] == ["a", "b"]
    assert [int((~each.occupied).sum()) for each in given] == [600, 400]
    unknown = load_world(paths[0]).occupied.copy()
    unknown[:3] = True
    part = World(Grid((30, 20, 1), 0.05), unknown, "part", unknown=unknown)
    wide = with_given_worlds(start, {"world": [part, load_world(paths[1])]})[1][0]
    assert wide.grid.shape == (30, 40, 1) and wide.unknown is not None and wide.unknown.sum() == 60
    worlds = [load_world(path) for path in paths]
    for several in (worlds, [paths[0], worlds[1]]):
        for one, two in zip(with_given_worlds(start, {"world": several})[1], given, strict=True):
            assert one.grid == two.grid
            np.testing.assert_array_equal(one.occupied, two.occupied)


def test_large_margins_of_a_given_world_are_cropped_and_places_stay():
    solid = np.ones((1200, 1000, 1), bool)
    solid[400:420, 700:730] = False
    with pytest.warns(WorldWarning, match="cropped from 1200 × 1000 to 22 × 32"):
        scenario, given = with_given_worlds(
            free_box(), {"world": World(Grid(solid.shape, 0.1), solid, "hall")}
        )
    assert scenario.grid.shape == (22, 32, 1)
    assert scenario.grid.origin_m == pytest.approx((39.9, 69.9, 0.0))
    assert (~given[0].occupied).sum() == 600 and given[0].occupied[0].all()


def test_missions_check_the_worlds_that_they_are_given():
    with pytest.raises(SettingError, match="a list of Worlds"):
        Missions(free_box(), given=("office",))
    with pytest.raises(WorldError, match=r"world\[1\]"):
        in_given_worlds(free_box(), [WORLDS[0], walled(2, grid=Grid(SHAPE, 0.5))])
    with pytest.raises(SettingError, match="or a World"):
        Missions(in_given_worlds(free_box(), WORLDS))  # its worlds are not there any more


def test_paths_of_the_same_file_are_read_once(tmp_path, monkeypatch):
    (tmp_path / "plan.pgm").write_bytes(pgm(sketch()))
    monkeypatch.chdir(tmp_path)
    near, far = ({"path": p} for p in ("plan.pgm", Path("..") / tmp_path.name / "plan.pgm"))
    first, second = (with_given_worlds(free_box(), {"world": asked})[1][0] for asked in (near, far))
    assert first is second
    shutil.copy("plan.pgm", "other.pgm")
    assert with_given_worlds(free_box(), {"world": {"path": "other.pgm"}})[1][0] is not first


@pytest.mark.parametrize(
    ("paths", "names", "short"),
    [
        (["x/plan.png"], ["plan"], ["plan.png"]),
        (
            ["a/plan.png", "b/plan.png", "hut.bt"],
            ["a/plan", "b/plan", "hut"],
            ["a/plan.png", "b/plan.png", "hut.bt"],
        ),
        (["a/plan.png", "a/plan.pgm"], ["plan.png", "plan.pgm"], ["plan.png", "plan.pgm"]),
        (["a/c/plan.png", "b/c/plan.png"], ["a/c/plan", "b/c/plan"], ["a/c/plan.png", "b/c/plan.png"]),
        (["a/plan.png", "a/plan.png"], ["plan", "plan"], ["plan.png", "plan.png"]),
    ],
)
def test_files_have_as_many_of_their_folders_as_tell_them_apart(paths, names, short):
    assert distinct_names([Path(path) for path in paths]) == names
    assert distinct_paths([Path(path) for path in paths]) == short
