"""The command: lists, draws and converts; errors are one line and exit code 2."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from benchmarks.proofs.world_samples import heights, npz, pgm, sketch
from entropy_explore_env.command import run_command
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.worlds.commands import main
from entropy_explore_env.worlds.formats import FORMATS
from entropy_explore_env.worlds.load import load_world, make_world


@pytest.fixture
def floor(tmp_path):
    path = tmp_path / "floor.pgm"
    path.write_bytes(pgm(sketch()))
    return path


def test_list_names_recipes_and_kinds(capsys):
    assert run_command(main, ["list"]) == 0
    names = [line.split("\t")[0] for line in capsys.readouterr().out.splitlines()]
    there = {*SCENARIOS, "jacksboro", "geb079", "dungeon-1 … dungeon-100", *(f"*{kind}" for kind in FORMATS)}
    assert there < set(names) and len(names) == len(set(names))


def test_list_of_a_folder(floor, capsys):
    (floor.parent / "below").mkdir()
    (floor.parent / "below" / "MAP.BT").write_bytes(b"")
    (floor.parent / "notes.txt").write_bytes(b"")
    assert run_command(main, ["list", str(floor.parent)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("\t")[0] for line in lines] == [str(floor.parent / "below" / "MAP.BT"), str(floor)]


@pytest.mark.parametrize("source", ["room-furnished", "floor.pgm"])
def test_show_writes_a_picture(floor, capsys, source):
    out = floor.parent / "pictures" / "world.png"
    given = source if source in SCENARIOS else str(floor)
    assert run_command(main, ["show", given, "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert said.out.startswith(f"{given}: ") and said.out.splitlines()[-1] == str(out) and said.err == ""
    assert "voxels of" in said.out
    assert "0.55 × 0.35 m" in said.out or "9 × 7 × 4 m" in said.out or source in SCENARIOS
    assert "may start in" in said.out or "have no room" in said.out
    assert out.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("words", [[], ["--out", "world.png"]])
def test_show_says_sizes_and_starts_without_matplotlib(floor, capsys, monkeypatch, words):
    monkeypatch.chdir(floor.parent)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert run_command(main, ["show", str(floor), *words]) == (2 if words else 0)
    said = capsys.readouterr()
    assert "0.55 × 0.35 m" in said.out and ("may start in" in said.out or "have no room" in said.out)
    told = "matplotlib is not installed: pip install 'entropy_explore_env[baselines]'"
    assert said.err.count("\n") == (1 if words else 0) and (told in said.err) is bool(words)
    assert not (floor.parent / "world.png").exists()


def test_a_world_of_a_number_is_that_of_make_world(tmp_path, capsys):
    for words in ([], ["--seed", "3"], ["--world-number", "3"]):
        assert run_command(main, ["convert", "office", str(tmp_path / "office.npz"), *words]) == 0
        found = load_world(tmp_path / "office.npz").occupied
        is_third = np.array_equal(found, make_world("office", 3).occupied)
        assert is_third == (words[:1] == ["--world-number"])
    assert run_command(main, ["show", "office", "--world-number", "3", "--out", str(tmp_path / "o.png")]) == 0
    assert capsys.readouterr().err == ""


def test_convert_keeps_the_world(tmp_path, capsys):
    (tmp_path / "hills.npz").write_bytes(npz(elevation=heights()))
    words = ["convert", str(tmp_path / "hills.npz"), str(tmp_path / "out.npz")]
    assert run_command(main, [*words, "--resolution-m", "0.5", "--ceiling-m", "2"]) == 0
    first = load_world(tmp_path / "hills.npz", resolution_m=0.5, ceiling_m=2.0)
    again = load_world(tmp_path / "out.npz")
    assert again.grid == first.grid and again.name == "hills"
    np.testing.assert_array_equal(again.occupied, first.occupied)
    np.testing.assert_array_equal(again.ceiling, first.ceiling)
