"""Compiled kernels lie where each system keeps what can be made again, and not for ever."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from numba.core import config

from entropy_explore_env.compilation import folder
from entropy_explore_env.compilation.folder import claim, kernel_folder, release, remove_old_kernels
from tests.systems import needs_posix

HOLD = "import sys; from pathlib import Path; from entropy_explore_env.compilation.folder import claim\n"
HOLD += "held = claim(Path(sys.argv[1])); print('held', flush=True); sys.stdin.read()"
DAY_S = 86400.0


@needs_posix
def test_the_variable_of_numba_comes_first(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setattr(config, "CACHE_DIR", "")
    assert kernel_folder() == tmp_path / "xdg" / "entropy_explore_env" / "kernels"
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "numba"))
    assert kernel_folder() == tmp_path / "numba" / "entropy_explore_env"


def test_without_a_home_there_is_no_folder(monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.setattr(folder.platformdirs, "user_cache_dir", lambda *_, **__: "~/.cache")
    assert kernel_folder() is None


def file(where: Path, name: str, days: float, size: int = 10) -> Path:
    made = where / name
    made.write_bytes(bytes(size))
    os.utime(made, (time.time() - days * DAY_S,) * 2)
    return made


def test_what_is_not_used_for_long_goes(tmp_path):
    days = {"a.kernel": 89.0, "b.part": 0.5, "old.txt": 999.0, "of a clock that jumped.kernel": -1000.0}
    kept = [file(tmp_path, name, old) for name, old in days.items()]
    gone = [file(tmp_path, "c.kernel", 91.0), file(tmp_path, "d.part", 2.0)]
    remove_old_kernels(tmp_path)
    assert [path.exists() for path in kept] == [True] * 4
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


@needs_posix
def test_the_second_waits_for_the_first(tmp_path):
    kernel, taken = tmp_path / "a.kernel", []
    first = claim(kernel)
    thread = threading.Thread(target=lambda: taken.append(claim(kernel)))
    thread.start()
    release(claim(tmp_path / "b.kernel"))  # another kernel is free meanwhile
    time.sleep(0.1)
    assert not taken
    release(first)
    thread.join(timeout=30)
    assert len(taken) == 1
    release(taken[0])
    assert not list(tmp_path.iterdir())


@needs_posix
def test_a_process_that_does_not_wait_is_told_that_another_has_it(tmp_path):
    kernel = tmp_path / "a.kernel"
    first = claim(kernel, waits=False)
    with pytest.raises(folder.ClaimedError):
        claim(kernel, waits=False)
    release(first)
    release(claim(kernel, waits=False))
    assert not list(tmp_path.iterdir())


@needs_posix
def test_a_process_that_dies_lets_go(tmp_path):
    kernel, pipe = tmp_path / "a.kernel", subprocess.PIPE
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(kernel)], stdin=pipe, stdout=pipe)
    assert process.stdout is not None and process.stdout.readline() == b"held\n"
    process.kill()
    process.communicate()
    began_s = time.monotonic()
    release(claim(kernel))
    assert time.monotonic() - began_s < 10.0


def test_nobody_waits_for_ever_nor_where_there_are_no_locks(tmp_path, monkeypatch):
    kernel = tmp_path / "a.kernel"
    first = claim(kernel)
    monkeypatch.setattr(folder, "_PATIENCE_S", 0.05)
    release(claim(kernel))
    monkeypatch.setattr(folder, "_PATIENCE_S", 1e6)
    monkeypatch.setattr(folder, "fcntl", None)
    release(claim(kernel))
    release(first)


@needs_posix
def test_a_file_system_without_locks_leaves_no_file_open(tmp_path, monkeypatch):
    opened = []

    def refuse(file, _):
        opened.append(file)
        raise OSError("No locks available")

    monkeypatch.setattr(folder.fcntl, "flock", refuse)
    assert claim(tmp_path / "a.kernel") is None
    assert [file.closed for file in opened] == [True]


def test_a_folder_that_cannot_be_written_is_no_matter(tmp_path):
    (tmp_path / "file").write_text("")
    release(claim(tmp_path / "file" / "a.kernel"))
