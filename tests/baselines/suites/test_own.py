"""Scenarios and world files of one's own as tasks of `baselines.benchmark`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from baselines import benchmark
from baselines.cli.arguments import parse, run_command
from baselines.suites import own
from benchmarks.proofs.world_samples import pgm
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import LAB, SCENARIOS
from entropy_explore_env.worlds.load import FORMATS, save_world
from entropy_explore_env.worlds.world import World

ROOT = Path(__file__).parents[3]


def tasks_of(*words):
    words = ["--robots", "1", *words]
    suite, refused = benchmark._suite(parse(benchmark.Args, words), words)
    return {task.places[0].name: task.scenario for task in suite.tasks}, refused


@pytest.fixture
def folder(tmp_path):
    """A plan with its YAML, an image without one, and a hut; the first image is no world of its own."""
    plan = np.full((30, 44), 254, np.uint8)
    plan[10:20, 15:18] = 0
    (tmp_path / "floor.pgm").write_bytes(pgm(plan))
    (tmp_path / "floor.yaml").write_text(
        "image: floor.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "bare.pgm").write_bytes(pgm(plan))
    solid = np.zeros((9, 12, 7), bool)
    solid[4, 5] = True
    save_world(World(Grid(solid.shape, 0.25), solid, "hut"), tmp_path / "hut.npz")
    (tmp_path / "notes.txt").write_text("no world")
    return tmp_path


def test_world_files_are_tasks_of_their_own_with_the_robots_that_they_need(folder):
    found, refused = tasks_of("--world", str(folder))
    assert list(found) == ["bare", "floor", "hut"] and refused == []
    assert all(one.track_truth and one.robots == 1 for one in found.values())
    assert found["hut"].grid.shape == (9, 12, 7) and found["hut"].robot.reach_m == 0.5  # those of the room
    assert found["floor"].grid.shape == (44, 30, 1) and found["floor"].robot.motion == "planar"
    assert found["bare"].grid.shape == (22, 15, 1)  # pixels of 0.05 m as voxels of 0.1 m
    words = "--world-scenario", "cave", "--time-limit-s", "77", "--robot.reach-m", "2"
    hut = tasks_of("--world", str(folder / "hut.npz"), *words)[0]["hut"]
    assert hut.robot.navigator == "planned" and hut.ending.time_limit_s == 77.0
    assert hut.grid.voxel_size_m == 0.4 and hut.robot.reach_m == 2.0


def test_a_file_that_cannot_be_used_is_refused_and_the_others_are_explored(folder, tmp_path, capsys):
    (folder / "below" / "broken.bt").write_bytes(b"no tree")
    words = ["--world", str(folder), "--strategies", "random", "--robots", "1", "--seeds", "1"]
    words += ["--jobs", "1", "--time-limit-s", "20", "--out", str(tmp_path / "out")]
    assert run_command(benchmark.main, words) == 0
    said = capsys.readouterr().out
    assert "refused: world file = " in said and "broken.bt" in said
    page = (tmp_path / "out" / "own.md").read_text()
    assert "Refused: world file = " in page and "**hut, 1 robot**: " in page and "| explored |" in page
    (folder / "only").mkdir()
    (folder / "only" / "broken.bt").write_bytes(b"no tree")
    words[1] = str(folder / "only" / "broken.bt")
    assert run_command(benchmark.main, words) == 2


def test_images_are_read_as_asked_and_files_that_say_it_themselves_are_not(folder):
    found, refused = tasks_of("--world", str(folder), "--resolution-m", "0.1", "--voxel-size-m", "0.2")
    assert found["bare"].grid.shape == (22, 15, 1) and refused == []
    assert found["floor"].grid.shape == (22, 15, 1) and found["hut"].grid.voxel_size_m == 0.2
    with pytest.raises(SettingError, match="resolution_m"):
        tasks_of("--world", str(folder / "hut.npz"), "--resolution-m", "0.1")
    with pytest.raises(SettingError, match=r"world = .*a folder with world files"):
        tasks_of("--world", str(folder / "empty" / ".."), "--world", str(ROOT / "requirements"))
    assert {*own._PLANS, *own._MESHES, *own._HEIGHTS} < set(FORMATS)
    assert {*own._PLANS, *own._MESHES, *own._HEIGHTS, *own._CLOUDS, ".bt", ".ot"} == set(FORMATS)


def test_several_scenarios_take_what_is_given_and_keep_the_rest():
    found, _ = tasks_of("--scenarios", "lab,office", "--sensor.max-range-m", "3")
    assert {one.sensor.max_range_m for one in found.values()} == {3.0}
    assert found["lab"].ending == LAB.ending and found["lab"].robot == LAB.robot
    assert found["office"].robot == SCENARIOS["office"].robot


def test_quick_shrinks_what_is_not_given():
    words = ["--quick", "--robots", "3", "--strategies", "random"]
    suite, _ = benchmark._suite(parse(benchmark.Args, words), words)
    assert [(cell.id, cell.seeds, cell.scenario.robots) for cell in suite.cells] == [
        ("room-3-robots/random", 5, 3),
        ("office-3-robots/random", 5, 3),
    ]
