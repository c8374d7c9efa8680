"""Files that are whole or not there, and a mission's time series."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import numpy as np
import pytest

from entropy_explore_env.reports.recording import Recorder, write_atomically
from tests.reference.scenes import free_box, random_actions, started

# --- files


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("content", [b"", b"\x00\xff" * 100_000, "σ ½\n", ""])
def test_a_file_holds_what_was_written_and_nothing_lies_beside_it(content, tmp_path):
    path = tmp_path / "mission.json"
    write_atomically(path, content)
    assert path.read_bytes() == (content.encode("utf-8") if isinstance(content, str) else content)
    assert names(tmp_path) == ["mission.json"]


def test_missing_folders_are_made(tmp_path, monkeypatch):
    write_atomically(tmp_path / "a" / "b" / "c.txt", "x")
    assert (tmp_path / "a" / "b" / "c.txt").read_text() == "x"
    monkeypatch.chdir(tmp_path)
    write_atomically(Path("plain.txt"), "y")
    assert (tmp_path / "plain.txt").read_text() == "y"


def test_everybody_may_read_the_file(tmp_path):
    """As for a file that was opened the usual way; temporary files are private."""
    path = tmp_path / "a.txt"
    before = os.umask(0o022)
    try:
        write_atomically(path, "x")
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644


def test_an_older_file_is_replaced_not_written_over(tmp_path):
    """Who reads the older file meanwhile reads it to its end."""
    path = tmp_path / "a.txt"
    path.write_text("older and longer")
    with path.open() as reader:
        write_atomically(path, "newer")
        assert reader.read() == "older and longer"
    assert path.read_text() == "newer"
    assert names(tmp_path) == ["a.txt"]


def test_until_all_is_on_the_disk_the_file_is_the_older_one(tmp_path, monkeypatch):
    path, really, seen = tmp_path / "a.txt", os.fsync, []
    path.write_text("older")

    def fsync(handle: int) -> None:
        (temporary,) = set(tmp_path.iterdir()) - {path}  # in the same folder: a rename within one disk
        seen.append((path.read_text(), temporary.read_text(), temporary.name.startswith(".")))
        really(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    write_atomically(path, "newer")
    assert seen == [("older", "newer", True)]


def fail_in_fsync(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def fsync(handle: int) -> None:
        raise error

    monkeypatch.setattr(os, "fsync", fsync)


def fail_in_replace(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def replace(self: Path, target: Path) -> None:
        raise error

    monkeypatch.setattr(Path, "replace", replace)


def fail_in_chmod(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def chmod(self: Path, mode: int) -> None:
        raise error

    monkeypatch.setattr(Path, "chmod", chmod)


@pytest.mark.parametrize("older", [None, "older"])
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("fail", [fail_in_fsync, fail_in_replace, fail_in_chmod])
def test_a_failure_leaves_what_was_there(fail, error, older, tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    if older is not None:
        path.write_text(older)
    with monkeypatch.context() as patch:
        fail(patch, error)
        with pytest.raises(type(error)):
            write_atomically(path, "newer")
    assert names(tmp_path) == ([] if older is None else ["a.txt"])
    assert older is None or path.read_text() == older
    write_atomically(path, "newer")
    assert path.read_text() == "newer"


def test_a_place_that_cannot_be_written_is_an_error_and_stays_as_it_was(tmp_path):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "file" / "a.txt", tmp_path / "folder"):
        with pytest.raises(OSError):
            write_atomically(path, "x")
    assert names(tmp_path) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == "mine" and names(tmp_path / "folder") == []


# --- a mission's series


def recorded(steps: int, robots: int = 3):
    """A recorder over some steps, and what the state said at each moment."""
    missions = started(free_box(robots=robots), seed=5)
    recorder, said, rng = Recorder(missions), [], np.random.default_rng(1)
    for step in range(steps + 1):
        if step:
            missions.step(*random_actions(missions, rng))
        recorder.note()
        state = missions.state.robots[0]
        said.append(
            (
                float(missions.state.missions[0]["time_s"]),
                state["entropy_bits"].copy(),
                int(state["scans"].sum()),
                int(state["measurements_sent"].sum()),
                state["scan_pose"][:, :3].copy(),
            )
        )
        assert recorder.latest_s == said[-1][0]
    return recorder, said


def test_a_recorder_keeps_every_moment_as_it_was():
    recorder, said = recorded(25)
    time_s, entropy_bits, scans, shared, places_m = (np.asarray(column) for column in zip(*said, strict=True))
    assert (recorder.time_s.shape, recorder.time_s.dtype) == ((26,), np.float64)
    assert (recorder.entropy_bits.shape, recorder.entropy_bits.dtype) == ((26, 3), np.float64)
    assert (recorder.places_m.shape, recorder.places_m.dtype) == ((26, 3, 3), np.float64)
    assert recorder.scans.shape == recorder.shared.shape == (26,)
    assert recorder.scans.dtype.kind == recorder.shared.dtype.kind == "i"
    np.testing.assert_array_equal(recorder.time_s, time_s)
    np.testing.assert_array_equal(recorder.entropy_bits, entropy_bits)
    np.testing.assert_array_equal(recorder.scans, scans)
    np.testing.assert_array_equal(recorder.shared, shared)
    np.testing.assert_array_equal(recorder.places_m, places_m)
    assert recorder.scans[-1] > 20 and recorder.shared[-1] > 0
    assert len(np.unique(recorder.entropy_bits[:, 0])) > 5


def test_one_moment_of_one_robot_has_the_same_axes():
    recorder, _ = recorded(0, robots=1)
    shapes = [
        getattr(recorder, name).shape for name in ("time_s", "entropy_bits", "scans", "shared", "places_m")
    ]
    assert shapes == [(1,), (1, 1), (1,), (1,), (1, 1, 3)]


def test_a_recorder_follows_the_first_mission_only():
    missions = started(free_box(robots=2), seed=5, missions=3)
    recorder, alone = Recorder(missions), Recorder(started(free_box(robots=2), seed=5))
    rng = np.random.default_rng(1)
    for _ in range(8):
        boxes, numbers = random_actions(missions, rng)
        missions.step(boxes, numbers)
        alone.missions.step(boxes[:1], numbers[:1])
        recorder.note()
        alone.note()
    np.testing.assert_array_equal(recorder.entropy_bits, alone.entropy_bits)
    np.testing.assert_array_equal(recorder.places_m, alone.places_m)
