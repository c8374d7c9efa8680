"""Warming says what it compiled, and that nothing was left to do."""

import pytest
from numba.core import config

from entropy_explore_env import warm
from entropy_explore_env.errors import SettingError
from entropy_explore_env.warm import Warmed, main


def test_the_second_time_nothing_is_left(capsys):
    assert main(["box-7x11x5", "--processes", "1"]) == 0
    first = capsys.readouterr().out.splitlines()
    assert first[-1].startswith(("Compiled ", "Nothing left to compile"))
    assert main(["box-7x11x5", "box-7x11x5"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("Nothing left to compile: all kernels are in ")


def test_it_says_what_was_compiled(capsys, monkeypatch):
    done = [Warmed("room", 3, 4.0), Warmed("office", 1, 2.5), Warmed("cave", 0, 0.1)]
    monkeypatch.setattr(warm, "_in_processes", lambda names, processes: done)
    assert main(["room", "office", "cave"]) == 0
    *scenarios, last = capsys.readouterr().out.splitlines()
    assert scenarios == ["room: compiled 3 kernels, 4.0 s", "office: compiled 1 kernel, 2.5 s"]
    assert last.startswith("Compiled 4 kernels in ")


def test_a_folder_that_cannot_be_written_is_an_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "file"))
    with pytest.raises(SettingError, match=r"NUMBA_CACHE_DIR = .*can be written"):
        main(["room"])
