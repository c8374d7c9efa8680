"""Files that are whole or not there."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from entropy_explore_env.writing import write_atomically


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


@pytest.mark.parametrize("older", [None, "older"])
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("place", [(os, "fsync"), (Path, "replace"), (Path, "chmod")])
def test_a_failure_leaves_what_was_there(place, error, older, tmp_path, monkeypatch):
    def fail(*_: object) -> None:
        raise error

    path = tmp_path / "a.txt"
    if older is not None:
        path.write_text(older)
    with monkeypatch.context() as patch:
        patch.setattr(*place, fail)
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
