"""`python -m baselines.replay`: the same mission again, told apart from any other."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from baselines import replay, run
from baselines.cli.arguments import run_command
from entropy_explore_env.reports.mission_record import load_record, save_record
from entropy_explore_env.settings.json import scenario_of
from entropy_explore_env.worlds import load
from entropy_explore_env.worlds.load import save_world
from tests.baselines.ran import SHORT, Ran, check_refused, without_clock
from tests.reference.scenes import free_box, started


@pytest.fixture
def command(capsys, monkeypatch):
    monkeypatch.setattr("baselines.cli.mission_picture.mission_picture", lambda *_: b"picture")

    def ran(main, *words: str | Path) -> Ran:
        code = run_command(main, [str(word) for word in words])
        return Ran(code, *capsys.readouterr())

    return ran


def test_a_replay_is_the_same_mission_and_draws_the_same_files(command, tmp_path):
    first, again = tmp_path / "first", tmp_path / "again"
    words = ("box-7x11x5", "--seed", "2", "--strategy", "random", "--channel.loss-probability", "0.5")
    ran = json.loads(command(run.main, *words, "--json", "--out", first, "--record", tmp_path / "r.npz").out)
    assert (tmp_path / "r.npz").read_bytes() == (first / "mission.npz").read_bytes()
    replayed = command(replay.main, first / "mission.npz", "--json", "--out", again)
    assert (replayed.code, replayed.err) == (0, "")
    figures = json.loads(replayed.out)
    assert without_clock(figures) == without_clock(ran)
    assert figures["replayed"]["same"] is True and figures["finished"]
    assert (again / "mission.gif").read_bytes() == (first / "mission.gif").read_bytes()
    assert not (again / "mission.npz").exists()  # a replay that differs must not replace the record
    kept, before = (json.loads((folder / "mission.json").read_text()) for folder in (again, first))
    assert (kept["series"], kept["settings"]) == (before["series"], before["settings"])
    assert scenario_of(kept["settings"]) == load_record(first / "mission.npz").scenario


def test_scan_times_and_commands_are_those_of_the_mission(command, tmp_path):
    figures = json.loads(
        command(run.main, "box-7x11x5", "--json", "--record", tmp_path / "r.npz", *SHORT).out
    )
    record = load_record(tmp_path / "r.npz")
    counts = np.bincount(record.scan_robot, minlength=2).tolist()
    assert counts == [robot["scans"] for robot in figures["per_robot"]]
    assert (np.diff(record.scan_s) >= 0.0).all() and record.scan_s[-1] <= figures["t_mission_s"]
    assert record.commands.dtype == np.float32 and record.commands.shape[1:] == (2, 5)


def test_a_person_reads_whether_it_was_the_same(command, tmp_path):
    command(run.main, "box-7x11x5", "--record", tmp_path / "r.npz", *SHORT)
    ran = command(replay.main, tmp_path / "r.npz")
    assert ran.code == 0 and "replayed bit for bit" in ran.out and "differs" not in ran.err


def edited(path: Path, **changes: object) -> Path:
    save_record(replace(load_record(path), **changes), path)
    return path


def test_another_end_is_one_line_and_code_1(command, tmp_path):
    """Of another command, or of another version."""
    path = tmp_path / "r.npz"
    command(run.main, "box-7x11x5", "--record", path, *SHORT)
    record = load_record(path)
    commands = record.commands.copy()
    commands[0, 1, 3] *= np.float32(0.5)  # its yaw
    for changes in ({"commands": commands}, {"digest": "0" * 64, "library": "9.8.7"}):
        save_record(replace(record, **changes), path)
        ran = command(replay.main, path, "--json")
        assert ran.code == 1 and ran.err.count("\n") == 1 and "differs" in ran.err
        assert json.loads(ran.out)["replayed"]["same"] is False
    assert "9.8.7" in ran.err


def test_bad_records_are_one_line_and_code_2(command, tmp_path):
    path = tmp_path / "r.npz"
    command(run.main, "box-7x11x5", "--record", path, *SHORT)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    beyond = edited_commands(tmp_path / "beyond.npz", whole)
    for bad in (path, tmp_path / "missing.npz", tmp_path, beyond):
        ran = command(replay.main, bad, "--out", tmp_path / "out")
        assert (ran.code, ran.err.count("\n")) == (2, 1) and ran.err.startswith("error: ")
        assert ran.out == "" and not list((tmp_path / "out").glob("*"))
    assert command(replay.main, tmp_path / "r.npz", "--wings").code == 2


def edited_commands(path: Path, whole: bytes) -> Path:
    """A record whose commands lie outside the action space."""
    path.write_bytes(whole)
    return edited(path, commands=2.0 + load_record(path).commands)


def test_a_world_file_that_changed_is_refused_and_one_that_moved_is_found(command, tmp_path):
    world, moved, path = tmp_path / "room.npz", tmp_path / "moved.npz", tmp_path / "r.npz"
    save_world(started(free_box(world="furnished"), seed=1).worlds[0], world)
    command(run.main, "box-7x11x5", "--world", world, "--record", path, *SHORT)
    assert command(replay.main, path, "--json").code == 0
    world.rename(moved)
    forget_worlds()
    gone = command(replay.main, path)
    assert gone.code == 2 and "room.npz" in gone.err
    assert command(replay.main, path, "--world-file", moved, "--json").code == 0
    save_world(started(free_box(world="furnished"), seed=2).worlds[0], moved)
    forget_worlds()
    other = command(replay.main, path, "--world-file", moved)
    assert other.code == 2 and "moved.npz" in other.err and other.out == ""


@pytest.mark.parametrize(
    "option", ["--settings", "--robots", "--seed", "--channel.burst", "--negate", "--world"]
)
def test_a_record_holds_its_settings(option, command, tmp_path):
    ran = command(replay.main, tmp_path / "r.npz", option, "3")
    assert (ran.code, ran.out) == (2, "") and ran.err.startswith(f"error: {option}: no such option")


def forget_worlds() -> None:
    """A process reads a file once."""
    load._cached_world.cache_clear()


def test_videos_and_recordings_of_any_run_and_of_a_replay(command, tmp_path):
    pytest.importorskip("av")
    pytest.importorskip("rerun")
    files = [tmp_path / "a" / "m.gif", tmp_path / "b" / "m.mp4", tmp_path / "m.rrd"]
    words = [word for file in files for word in (f"--{file.suffix[1:].replace('rrd', 'rerun')}", file)]
    ran = command(run.main, "box-7x11x5", *words, "--record", tmp_path / "r.npz", *SHORT)
    assert ran.code == 0 and "m.mp4" in ran.out
    before = [file.read_bytes() for file in files]
    assert all(len(content) > 1000 for content in before)
    assert command(replay.main, tmp_path / "r.npz", "--json", *words).code == 0
    assert [file.read_bytes() for file in files[:2]] == before[:2]
    assert not [path for path in tmp_path.rglob(".*")]


@pytest.mark.parametrize("option", ["gif", "mp4", "out", "record", "rerun"])
def test_files_that_cannot_be_written_are_refused_before_the_mission(option, command, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "run_mission", lambda *_: pytest.fail("the mission ran"))
    (tmp_path / "taken").write_text("mine")
    for file in (tmp_path / "taken" if option == "out" else tmp_path, tmp_path / "taken" / "m"):
        check_refused(command(run.main, "box-7x11x5", f"--{option}", file, "--json"), [option])
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize(("option", "module"), [("mp4", "av"), ("rerun", "rerun")])
def test_missing_packages_are_named_before_the_mission(option, module, command, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "run_mission", lambda *_: pytest.fail("the mission ran"))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == module else object())
    ran = command(run.main, "box-7x11x5", f"--{option}", tmp_path / "m")
    assert ran.code == 2 and "[viewer]" in ran.err


def test_an_interrupted_recording_leaves_nothing(command, tmp_path, monkeypatch):
    pytest.importorskip("rerun")

    def interrupted(env, strategy, seed, after_step, before_step) -> None:
        env.reset(seed=0)
        after_step(env)
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "run_mission", interrupted)
    ran = command(run.main, "box-7x11x5", "--rerun", tmp_path / "m.rrd", "--json")
    assert ran.code == 130 and list(tmp_path.iterdir()) == []
