"""Who waits for a compiler is told once, and told when it is over."""

import logging
import multiprocessing
from pathlib import Path

import pytest

from entropy_explore_env.compilation import announcement


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    monkeypatch.setattr(announcement, "_progress", announcement._Progress())
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: None)


def compile_two(folder: Path | None = None) -> None:
    for name in ("begin", "step"):
        with announcement.compiling(name, folder):
            pass


def test_one_line_before_and_one_after(caplog):
    compile_two(Path.home() / ".cache" / "kernels")
    assert announcement.compiled_kernels() == ("begin", "step")
    announcement.end_of_step()
    announcement.end_of_step()
    compile_two()
    announcement.end_of_step()
    assert [record.getMessage() for record in caplog.records] == [
        "entropy_explore_env: compiling kernels, up to a minute; they are kept in ~/.cache/kernels",
        "entropy_explore_env: compiled 2 kernels in 0 s",
    ]
    assert {(record.name, record.levelno) for record in caplog.records} == {
        ("entropy_explore_env", logging.WARNING)
    }


def test_seconds_of_compiling_are_counted(monkeypatch):
    clock = iter([10.0, 12.0])
    monkeypatch.setattr(announcement.time, "perf_counter", lambda: next(clock))
    assert announcement.compiling_s() == 0.0
    with announcement.compiling("step", None):
        pass
    assert announcement.compiling_s() == 2.0


def test_nothing_is_said_when_all_comes_from_disk(caplog):
    announcement.end_of_step()
    assert not caplog.records and announcement.compiled_kernels() == ()


def test_workers_are_silent(caplog, monkeypatch):
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: multiprocessing.current_process())
    compile_two()
    announcement.end_of_step()
    assert not caplog.records
