"""A folder of worlds is explored file by file, and the table says how far."""

from __future__ import annotations

import json

import numpy as np
import pytest

from baselines import world_sweep
from baselines.cli.arguments import run_command
from benchmarks.proofs.world_samples import pgm
from entropy_explore_env.settings import Grid
from entropy_explore_env.worlds.formats import FORMATS
from entropy_explore_env.worlds.load import save_world
from entropy_explore_env.worlds.world import World

SHORT = ["--time-limit-s", "20", "--strategy", "random"]


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
    below = tmp_path / "below"
    below.mkdir()
    (below / "bare.pgm").write_bytes(pgm(plan))
    solid = np.zeros((9, 12, 7), bool)
    solid[4, 5] = True
    save_world(World(Grid(solid.shape, 0.25), solid, "hut"), tmp_path / "hut.npz")
    (tmp_path / "notes.txt").write_text("no world")
    return tmp_path


def test_every_world_of_the_folder_has_a_row(folder, capsys):
    out = folder / "table.md"
    assert run_command(world_sweep.main, [str(folder), *SHORT, "--out", str(out)]) == 0
    said = capsys.readouterr()
    rows = [line.split(" | ") for line in said.out.split("\n\n")[0].splitlines()[2:]]
    assert [row[0].strip("| ") for row in rows] == ["bare.pgm", "floor.yaml", "hut.npz"]
    assert [row[1] for row in rows] == ["22 × 15", "44 × 30", "9 × 12 × 7"]
    assert {row[3] for row in rows} <= {"MAPPED", "TIME_UP"}
    assert "3 of 3: hut.npz" in said.err
    assert all(line in out.read_text() for line in said.out.splitlines())
    command = f"python -m baselines.world_sweep {folder.name} --strategy random --time-limit-s 20"
    about = f"Made by `{command}`: strategy random, 2 robots, seed 0; missions are cut off after 20 s."
    assert about in out.read_text()
    more = [line.split(" | ") for line in said.out.split("\n\n")[1].splitlines()]
    assert len(more[0]) == 15 and more[0][5] == "best map (bits)"
    assert [row[0].strip("| ") for row in more[2:]] == [row[0].strip("| ") for row in rows]
    assert all(float(row[9].replace(",", "")) > 0 for row in more[2:])  # driven


def test_results_as_one_object(folder, capsys):
    assert run_command(world_sweep.main, [str(folder), *SHORT, "--json"]) == 0
    said = capsys.readouterr()
    worlds = json.loads(said.out)["worlds"]
    assert [world["world"] for world in worlds] == ["bare.pgm", "floor.yaml", "hut.npz"]
    assert all(0.0 < world["explored"] <= 1.0 and world["scans"] > 0 for world in worlds)
    listed = {"t50_s", "t90_s", "t99_s", "entropy_mean_bits", "joint_bits", "wrong", "overlap", "balance"}
    listed |= {"distance_m", "blocked_moves", "bits_sent", "bits_gained_per_bit_sent", "scans_over_floor"}
    assert all(listed <= set(world) for world in worlds)
    assert said.err == ""


def test_a_world_that_cannot_be_used_is_a_row_and_the_others_are_explored(folder, capsys):
    (folder / "below" / "broken.bt").write_bytes(b"no tree")
    assert run_command(world_sweep.main, [str(folder), *SHORT]) == 0
    said = capsys.readouterr().out
    head = said.split("\n\n")[0]
    rows = [line.split(" | ") for line in head.splitlines() if line.startswith("| ")][2:]
    assert [row[0].strip("| ") for row in rows if row[3] == "refused"] == ["broken.bt"]
    assert len(rows) == 4 and "\nRefused: world file = " in said
    assert run_command(world_sweep.main, [str(folder), *SHORT, "--json"]) == 0
    refused = [row for row in json.loads(capsys.readouterr().out)["worlds"] if "refused" in row]
    assert [row["world"] for row in refused] == ["broken.bt"] and "\n" not in refused[0]["refused"]


def test_images_are_read_as_asked_and_files_that_say_it_themselves_are_not(folder, capsys):
    words = [str(folder), *SHORT, "--json", "--resolution-m", "0.1", "--negate"]
    assert run_command(world_sweep.main, words) == 0
    rows = {row["world"]: row for row in json.loads(capsys.readouterr().out)["worlds"]}
    assert rows["floor.yaml"]["voxels"] == "44 × 30" and rows["floor.yaml"]["scans"] > 0
    assert "room for a body" in rows["bare.pgm"]["refused"]  # what is dark is 3 pixels wide
    assert run_command(world_sweep.main, words[:-1]) == 0
    rows = {row["world"]: row for row in json.loads(capsys.readouterr().out)["worlds"]}
    assert rows["bare.pgm"]["voxels"] == "44 × 30"


def test_files_of_every_kind_are_looked_for():
    assert set(FORMATS) == set(world_sweep._SUFFIXES)
    assert set(world_sweep._PLANS) < set(FORMATS)


@pytest.mark.parametrize(
    "words", [["nowhere"], ["{}"], ["{}", "--strategy", "magic"], ["{}", "--robots", "0"]]
)
def test_bad_input_is_one_line(words, tmp_path, capsys):
    assert run_command(world_sweep.main, [word.format(tmp_path) for word in words]) == 2
    said = capsys.readouterr()
    assert not said.out and said.err.startswith("error: ") and said.err.count("\n") == 1


def test_the_options_of_the_task_hold_for_the_worlds_that_they_fit(folder, capsys):
    """Files named one by one; two of one name are told apart; an option for plans leaves the hut alone."""
    twin = folder / "below" / "hut.npz"
    twin.write_bytes((folder / "hut.npz").read_bytes())
    files = [str(folder / "hut.npz"), str(twin), str(folder / "floor.yaml")]
    words = [
        "--world",
        *files,
        *SHORT,
        "--height-m",
        "1.0",
        "--plan-voxel-size-m",
        "0.2",
        "--robot.reach-m",
        "2",
    ]
    out = folder / "table.md"
    assert run_command(world_sweep.main, [*words, "--json", "--out", str(out)]) == 0
    rows = json.loads(capsys.readouterr().out)["worlds"]
    assert [row["world"] for row in rows] == [files[0], files[1], "floor.yaml"]
    assert [row.get("voxels") for row in rows] == ["9 × 12 × 7", "9 × 12 × 7", "22 × 15 × 5"]
    worlds = f"{folder.name}/hut.npz below/hut.npz floor.yaml"
    told = f"--plan-voxel-size-m 0.2 --world {worlds} --height-m 1 --robot.reach-m 2"
    assert f"python -m baselines.world_sweep --strategy random {told} --time-limit-s 20`" in out.read_text()
    assert run_command(world_sweep.main, [str(folder), "--robot.reach-m", "-1"]) == 2
    assert capsys.readouterr().err.startswith("error: ")
