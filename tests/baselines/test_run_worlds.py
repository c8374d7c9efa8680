"""World files and starts of `python -m baselines.run`."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from baselines import replay, run
from baselines.cli.arguments import run_command
from baselines.cli.world_options import Reading
from benchmarks.proofs.world_samples import pgm
from entropy_explore_env.reports.mission_record import load_record
from entropy_explore_env.worlds.formats import LOAD_OPTIONS
from tests.baselines.ran import SHORT


@pytest.fixture
def floor(tmp_path):
    """A plan of 6 × 5 m with a pillar, at 0.1 m a pixel."""
    shades = np.full((50, 60), 254, np.uint8)
    shades[20:30, 15:18] = 0
    path = tmp_path / "floor.pgm"
    path.write_bytes(pgm(shades))
    return path


def test_a_world_file_is_read_as_asked_and_replayed_from_the_record(floor, command, capsys, tmp_path):
    record = tmp_path / "r.npz"
    asked = "--resolution-m 0.1 --height-m 2 --voxel-size-m 0.2 --robots 2 --json".split()
    ran = json.loads(command("room", "--world", str(floor), *asked, "--record", str(record), *SHORT).out)
    assert (ran["scenario"], ran["world"]) == ("room", "floor")
    kept = load_record(record)
    assert kept.scenario.grid.shape == (30, 25, 10) and kept.world.occupied[8, 12].all()
    floor.unlink()  # the record holds the world
    assert run_command(replay.main, [str(record), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["replayed"]["same"] is True


def test_starts_and_a_world_number_are_taken_recorded_and_replayed(command, capsys, tmp_path):
    record, file = tmp_path / "r.npz", tmp_path / "starts.json"
    poses = [[0.75, 0.75, 0.75, 0.5, 0.1], [0.75, 3.75, 0.75, -2.0, -0.1]]
    file.write_text(json.dumps(poses))
    words = ("box-7x11x5", "--world-number", "12", "--record", str(record), "--json", *SHORT)
    ran = [json.loads(command(*words, "--starts", given).out) for given in (json.dumps(poses), str(file))]
    assert [each.pop("wall_s") >= 0.0 for each in ran] == [True] * 2 and ran[0] == ran[1]
    kept = load_record(record)
    assert kept.starts.tolist() == poses and kept.world_number == 12
    assert run_command(replay.main, [str(record), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["replayed"]["same"] is True
    planar = ("--robot.motion", "planar", "--starts", "[[0.75, 0.75, 0.5], [0.75, 3.75, -2]]")
    command(*words, *planar)
    assert load_record(record).starts.tolist() == [
        [0.75, 0.75, 0.75, 0.5, 0.0],
        [0.75, 3.75, 0.75, -2.0, 0.0],
    ]


def test_a_file_without_options_stays_a_setting_of_the_scenario(floor, command, tmp_path):
    record = tmp_path / "r.npz"
    assert command("office", "--world", str(floor), "--record", str(record), "--json", *SHORT).code == 0
    assert load_record(record).scenario.world == str(floor) and load_record(record).world is None


def test_the_table_says_whose_robots_explore_a_loaded_world(floor, command):
    words = ("--world", str(floor), "--resolution-m", "0.1", "--voxel-size-m", "0.1", *SHORT)
    for scenario, more, said, range_said in (
        ("office", (), "those of office", "8 m"),
        ("room", (), "those of room", "the whole world"),
        ("room", ("--robot.max-speed-m-s", "0.5"), "those of room, changed", "the whole world"),
        ("room", ("--sensor.max-range-m", "2.5"), "those of room, changed", "2.5 m"),
    ):
        lines = [f"{line} " for line in command(scenario, *words, *more).out.splitlines()]
        assert any("sensor's range" in line and f" {range_said} " in line for line in lines)
        assert any("robots and sensor" in line and f" {said} " in line for line in lines)
        assert any(" 60 × 50 voxels of 0.1 m " in line for line in lines)
        assert any(" 6 × 5 m " in line for line in lines)


def test_every_option_of_load_world_is_an_option_of_the_command():
    options = {field.name for field in dataclasses.fields(Reading)}
    assert options - {"hollow"} | {"fill", "voxel_size_m"} == set(LOAD_OPTIONS)
    asked = Reading(height_m=1.0, negate=True, free_above=3.0, map_rule="nav2", hollow=True).options()
    assert asked == {"height_m": 1.0, "negate": True, "free_above": 3.0, "map_rule": "nav2", "fill": False}
    assert Reading().options() == {}


def test_flying_robots_in_a_flat_plan_are_told_that_they_stay_in_its_plane(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "plan.pgm").write_bytes(pgm(np.full((30, 40), 254, np.uint8)))
    words = ["--strategy", "random", "--world", "~/plan.pgm", "--robots", "1", "--json", "--seed", "1e0"]
    words += ["--ending.max-cycles", "3e0", "--voxel-size-m", "0.1"]
    assert run.main(["room", *words]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["seed"] == 1
    assert "plan.pgm is one voxel high: robots stayed in its plane and looked level" in said.err
    assert run.main(["room", *words, "--height-m", "1.0"]) == 0
    assert "one voxel high" not in capsys.readouterr().err
    assert run.main(["office", *words]) == 0
    assert "one voxel high" not in capsys.readouterr().err
