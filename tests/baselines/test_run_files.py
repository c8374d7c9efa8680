"""Files that `python -m baselines.run` writes."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from baselines import run
from baselines.cli import mission_outputs as mission_log
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from tests.baselines.ran import FILES, SHORT


def read_gif(path: Path) -> list[np.ndarray]:
    with Image.open(path) as animation:
        frames = []
        for number in range(animation.n_frames):  # type: ignore[attr-defined]
            animation.seek(number)
            frames.append(np.asarray(animation.convert("RGB")))
    return frames


def test_the_files_are_whole(command, tmp_path):
    folder = tmp_path / "a" / "b"
    ran = command("box-7x11x5", "--seed", "2", "--out", str(folder), "--json")
    assert (ran.code, ran.err) == (0, "")
    assert sorted(path.name for path in folder.iterdir()) == FILES
    printed = json.loads(ran.out)
    kept = json.loads((folder / "mission.json").read_text(), parse_constant=pytest.fail)
    assert {name: kept[name] for name in printed} == printed
    check_series(kept)
    assert kept["settings"]["grid"]["shape"] == [7, 11, 5]
    assert kept["settings"]["sensor"]["max_range_m"] == "inf"
    assert kept["settings"]["channel"]["burst"] == 8
    with Image.open(folder / "mission.png") as picture:
        picture.load()
        assert picture.format == "PNG" and min(picture.size) > 500
        assert len(np.unique(np.asarray(picture.convert("L")))) > 50
    frames = read_gif(folder / "mission.gif")
    assert 10 <= len(frames) <= 102
    assert all(frame.shape == (480, 640, 3) for frame in frames)
    assert (frames[0] != frames[-1]).any()


def check_series(kept: dict) -> None:
    series = kept["series"]
    lengths = {name: len(values) for name, values in series.items()}
    assert len(set(lengths.values())) == 1 and 2 < lengths["time_s"] <= 1001
    assert series["time_s"][0] == 0.0 and series["time_s"][-1] == kept["t_mission_s"]
    assert (np.diff(series["time_s"]) > 0).all()
    entropy = np.asarray(series["entropy_bits"])
    assert entropy.shape == (lengths["time_s"], kept["robots"])
    assert (entropy[0] == kept["entropy_start_bits"]).all() and entropy[-1].min() == kept["entropy_end_bits"]
    assert (np.diff(entropy, axis=0) <= 1e-9).all()
    assert series["scans"][-1] == kept["scans"]
    assert series["shared_measurements"][-1] == kept["shared_measurements"]


def test_a_long_mission_keeps_its_ends_and_not_too_many_moments(command, tmp_path, monkeypatch):
    monkeypatch.setattr(mission_log, "_SERIES_POINTS", 20)
    monkeypatch.setattr(mission_log, "_GIF_PICTURES", 10)
    fake_pictures(monkeypatch)
    assert command("box-7x11x5", "--out", str(tmp_path), "--json").code == 0
    kept = json.loads((tmp_path / "mission.json").read_text())
    check_series(kept)
    assert len(kept["series"]["time_s"]) <= 41
    frames = read_gif(tmp_path / "mission.gif")
    assert 4 <= len(frames) <= 14


def fake_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Save the time that matplotlib takes."""
    monkeypatch.setattr("baselines.cli.mission_picture.mission_picture", lambda *_: b"picture")


def test_the_table_says_what_was_written(command, tmp_path, monkeypatch):
    fake_pictures(monkeypatch)
    folder = tmp_path / "a long name of a folder that no table may break into two lines" / "results"
    ran = command("box-7x11x5", "--out", str(folder), *SHORT)
    assert ran.code == 0 and f"{folder}/mission.json" in ran.out


def test_an_interrupted_mission_prints_and_writes_nothing(command, tmp_path, monkeypatch):
    def interrupted(env: EntropyExploreEnv, *_: object) -> None:
        env.reset(seed=0)
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "run_mission", interrupted)
    ran = command("box-7x11x5", "--json", "--out", str(tmp_path / "out"))
    assert ran == (130, "", "interrupted\n")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.mark.parametrize("done", [0, 1, 2])
def test_files_are_whole_or_not_there_when_writing_is_interrupted(done, command, tmp_path, monkeypatch):
    """Interrupted in the fsync of the file after the first `done`; an older file stays as it was."""
    fake_pictures(monkeypatch)
    (tmp_path / "mission.json").write_text("older")
    calls, really = [], os.fsync

    def fsync(handle: int) -> None:
        calls.append(handle)
        if len(calls) > done:
            raise KeyboardInterrupt
        really(handle)

    monkeypatch.setattr("os.fsync", fsync)
    ran = command("box-7x11x5", "--json", "--out", str(tmp_path), *SHORT)
    assert ran == (130, "", "interrupted\n")
    written = ["mission.json", "mission.png", "mission.gif"][: max(done, 1)]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(written)
    if done == 0:
        assert (tmp_path / "mission.json").read_text() == "older"
    else:
        check_series(json.loads((tmp_path / "mission.json").read_text()))
    if done == 2:
        assert (tmp_path / "mission.png").read_bytes() == b"picture"
