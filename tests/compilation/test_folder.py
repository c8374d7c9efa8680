"""Compiled kernels lie where each system keeps what can be made again, and not for ever."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from numba.core import config

from entropy_explore_env.compilation import folder
from entropy_explore_env.compilation.folder import kernel_folder, remove_old_kernels, user_cache_folder

HOME = Path("/home/user")
DAY_S = 86400.0


@pytest.mark.parametrize(
    "platform, environment, expected",
    [
        ("linux", {}, HOME / ".cache"),
        ("linux", {"XDG_CACHE_HOME": "/scratch"}, Path("/scratch")),
        ("linux", {"XDG_CACHE_HOME": "relative"}, HOME / ".cache"),
        ("linux", {"XDG_CACHE_HOME": "", "LOCALAPPDATA": "/no"}, HOME / ".cache"),
        ("freebsd14", {}, HOME / ".cache"),
        ("darwin", {"XDG_CACHE_HOME": "/scratch"}, HOME / "Library" / "Caches"),
        ("win32", {"LOCALAPPDATA": "/users/user/local"}, Path("/users/user/local")),
        ("win32", {"XDG_CACHE_HOME": "/scratch"}, HOME / "AppData" / "Local"),
    ],
)
def test_each_system_has_its_folder(platform, environment, expected):
    assert user_cache_folder(platform, environment, HOME) == expected


@pytest.mark.parametrize("platform", ["linux", "darwin", "win32"])
def test_a_user_without_a_home_has_none(platform):
    assert user_cache_folder(platform, {}, None) is None


def test_the_variable_of_numba_comes_first(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr(config, "CACHE_DIR", "")
    assert kernel_folder() == tmp_path / "xdg" / "entropy_explore_env" / "kernels"
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "numba"))
    assert kernel_folder() == tmp_path / "numba" / "entropy_explore_env"


def test_without_a_home_there_is_no_folder(monkeypatch):
    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(config, "CACHE_DIR", "")
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", nowhere)
    assert kernel_folder() is None


def file(where: Path, name: str, days: float, size: int = 10) -> Path:
    made = where / name
    made.write_bytes(bytes(size))
    os.utime(made, (time.time() - days * DAY_S,) * 2)
    return made


def test_what_is_not_used_for_long_goes(tmp_path):
    kept = [file(tmp_path, "a.kernel", 89.0), file(tmp_path, "b.part", 0.5), file(tmp_path, "old.txt", 999.0)]
    gone = [file(tmp_path, "c.kernel", 91.0), file(tmp_path, "d.part", 2.0)]
    remove_old_kernels(tmp_path)
    assert [path.exists() for path in kept] == [True] * 3
    assert [path.exists() for path in gone] == [False] * 2


def test_where_there_is_too_much_what_was_used_longest_ago_goes(tmp_path):
    files = [file(tmp_path, f"{days}.kernel", days, 100) for days in range(1, 9)]
    remove_old_kernels(tmp_path, max_bytes=800)
    assert all(path.exists() for path in files)
    remove_old_kernels(tmp_path, max_bytes=799)
    assert [path.exists() for path in files] == [True] * 3 + [False] * 5


def test_a_folder_that_is_not_there_has_nothing_to_remove(tmp_path):
    remove_old_kernels(tmp_path / "none")


def test_use_is_noted_once_a_day(tmp_path):
    today, earlier = file(tmp_path, "a.kernel", 0.5), file(tmp_path, "b.kernel", 2.0)
    before = today.stat().st_mtime
    for path in (today, earlier, tmp_path / "none.kernel"):
        folder.mark_used(path)
    assert today.stat().st_mtime == before
    assert time.time() - earlier.stat().st_mtime < DAY_S
