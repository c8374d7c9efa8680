"""The process that files are read in: limits, crashes, and life after them."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks.proofs.world_samples import image, mesh, octomap_bytes, pgm, saved_world, sketch
from entropy_explore_env.errors import WorldError
from entropy_explore_env.worlds.files import process
from entropy_explore_env.worlds.files.process import Format, Limits, ReaderProcess, kept_reader
from entropy_explore_env.worlds.load import load_world
from tests.systems import needs_posix

WINDOWS = """
import signal, sys, time, types
sys.modules["resource"] = None
del signal.setitimer
slow = types.ModuleType("entropy_explore_env.worlds.files.slow")
slow.NEEDS, slow.read = (), lambda path, options: time.sleep(60.0)
sys.modules[slow.__name__] = slow
"""
"""What a reading process begins with to lack what Windows lacks; and a reader that takes a minute."""
IMAGE = Format("images", "PNG or PGM image")


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "plan.pgm"
    path.write_bytes(pgm(sketch()))
    return path


@needs_posix
def test_a_process_that_died_is_started_anew(picture):
    reader = ReaderProcess()
    first = reader.read(IMAGE, picture, {})
    number = reader._process.pid
    assert reader.read(IMAGE, picture, {}).labels.shape == first.labels.shape
    assert reader._process.pid == number  # one process, many files
    os.kill(number, signal.SIGKILL)
    reader._process.wait()
    np.testing.assert_array_equal(reader.read(IMAGE, picture, {}).labels, first.labels)
    assert reader._process.pid != number
    reader.close()
    assert reader._process is None


def test_what_takes_too_long_is_ended_and_says_so(tmp_path):
    path = tmp_path / "box.stl"
    path.write_bytes(mesh("stl"))
    start = time.perf_counter()
    with kept_reader() as reader:
        with pytest.raises(WorldError, match=r"read within 0\.1 s of computing"):
            load_world(path, 0.02, read_limit_s=0.1)
        assert time.perf_counter() - start < 20.0
        assert reader.cost is None
        assert load_world(path, 0.5).grid.shape == (14, 10, 8)


def test_what_takes_too_much_memory_is_refused_and_the_process_lives(tmp_path, monkeypatch):
    path = tmp_path / "plan.pgm"
    path.write_bytes(pgm(np.full((3000, 1000), 254, np.uint8)))
    with kept_reader() as reader:
        with monkeypatch.context() as little:
            little.setattr(process, "_MOST_MEMORY_BYTES", 8 << 20)
            with pytest.raises(WorldError, match="read within 8 MiB"):
                load_world(path)
        number = reader._process.pid
        path.write_bytes(pgm(sketch()))
        assert load_world(path).grid.shape == (11, 7, 1)
        assert reader._process.pid == number


def test_without_a_kept_process_each_file_has_its_own(picture, monkeypatch):
    started = []

    class Noted(ReaderProcess):
        def _running(self):
            running = super()._running()
            started.append(running)
            return running

    monkeypatch.setattr(process, "ReaderProcess", Noted)
    token = process._KEPT.set(None)
    for _ in range(2):
        load_world(picture)
    process._KEPT.reset(token)
    assert len({each.pid for each in started}) == 2
    assert all(each.poll() is not None for each in started)


def test_a_process_can_write_no_file_and_imports_little(picture):
    with kept_reader() as reader:
        load_world(picture)
        about = Path(f"/proc/{reader._process.pid}")
        if not about.exists():
            pytest.skip("this system has no /proc")
        maps, limits = (about / "maps").read_text(), (about / "limits").read_text()
    assert "llvmlite" not in maps and "numpy" in maps
    assert [line.split()[3] for line in limits.splitlines() if line.startswith("Max file size")] == ["0"]


@pytest.fixture
def as_on_windows(monkeypatch):
    """A reading process without limits and timer; that it was killed cannot be told by its exit code."""
    monkeypatch.setattr(process, "_BOOT", WINDOWS + process._BOOT)
    monkeypatch.setattr(subprocess.Popen, "kill", subprocess.Popen.terminate)
    with kept_reader() as reader:
        yield reader


@pytest.mark.parametrize(
    ("name", "data", "shape"),
    [
        ("plan.png", lambda: image(sketch()), (11, 7, 1)),
        ("world.npz", saved_world, (7, 11, 5)),
        ("tree.bt", lambda: octomap_bytes(".bt"), None),
    ],
)
def test_files_are_read_where_the_system_has_no_limits(tmp_path, as_on_windows, name, data, shape):
    path = tmp_path / name
    path.write_bytes(data())
    world = load_world(path, read_memory_mib=1000.0)
    assert shape is None or world.grid.shape == shape
    cost = as_on_windows.cost
    assert cost["cpu_s"] > 0.0 and (cost["peak_kib"] > 1000 or math.isnan(cost["peak_kib"]))
    with kept_reader():
        np.testing.assert_array_equal(load_world(path).occupied, world.occupied)


def test_what_takes_too_long_is_ended_where_the_system_has_no_limits(picture, as_on_windows, monkeypatch):
    with monkeypatch.context() as soon:
        soon.setattr(process, "_START_S", 1.0)
        with pytest.raises(
            WorldError, match=r"read within 0\.05 s of computing \(read_limit_s, --read-limit-s, allows more"
        ):
            as_on_windows.read(Format("slow", "slow file"), picture, {}, Limits(cpu_s=0.05))
    assert as_on_windows.cost is None
    assert load_world(picture).grid.shape == (11, 7, 1)
