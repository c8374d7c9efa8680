"""Troubles of the machine: full disks, folders that cannot be written, no home, clocks that jump.

Nothing half written stays, what was there before is still there, one line says what happened, and who goes on
later comes to the same bytes. A full disk is a limit on the size of files here: both are errors of writing.
"""

from __future__ import annotations

import shutil
from contextlib import contextmanager
from pathlib import Path

import pytest
from numba.core import config

from baselines import benchmark
from baselines.cli.arguments import run_command
from benchmarks.proofs.kills import contents
from entropy_explore_env.compilation import announcement
from entropy_explore_env.compilation.kernels import lean_kernel

resource = pytest.importorskip("resource", reason="POSIX limits the size of files")

TINY = ("--scenarios", "box-7x11x5", "--robots", "1", "--time-limit-s", "40", "--strategies", "gradient")
SWEEP = (*TINY, "--seeds", "2", "--jobs", "1", "--out")
UNWRITABLE = Path("/proc/nowhere")

needs_proc = pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder that nobody can write")


@contextmanager
def files_of_at_most(size):
    """While a file cannot be longer than so many bytes, in this process."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    assert run_command(benchmark.main, [*SWEEP, str(folder)]) == 0
    return contents(folder)


@pytest.mark.parametrize(
    ("size", "ran"), [(300, False), (3000, False), (3000, True)], ids=["first row", "later row", "figure"]
)
def test_a_sweep_on_a_full_disk_says_so_and_goes_on_later(undisturbed, tmp_path, capsys, size, ran):
    if ran:
        assert run_command(benchmark.main, [*SWEEP, str(tmp_path)]) == 0
        shutil.rmtree(tmp_path / "own")
    with files_of_at_most(size):
        assert run_command(benchmark.main, [*SWEEP, str(tmp_path)]) != 0
    said = capsys.readouterr()
    assert said.err.splitlines()[-1].endswith("File too large") and "Traceback" not in said.err
    written = [path for path in tmp_path.rglob("*") if path.is_file() and path.suffix != ".lock"]
    tables = [path.read_bytes() for path in written if path.suffix == ".jsonl"]
    assert all(table.endswith(b"\n") for table in tables if table), "rows are whole"
    assert not [path for path in written if path.name.startswith(".")], "no temporary file stays"
    assert run_command(benchmark.main, [*SWEEP, str(tmp_path)]) == 0
    assert contents(tmp_path) == undisturbed


def test_a_checkpoint_on_a_full_disk_leaves_the_one_before(tmp_path):
    import torch

    from entropy_explore_env.settings.scenarios import BOX
    from training.checkpoints import Checkpoint, PolicySettings, latest_checkpoint, save_checkpoint

    def checkpoint(steps):
        return Checkpoint(PolicySettings(BOX), {"steps": steps}, {"layer": torch.zeros(1000)}, {})

    save_checkpoint(tmp_path / "step-1", checkpoint(1))
    for size in (100, 2000):
        with files_of_at_most(size), pytest.raises(OSError, match="too large"):
            save_checkpoint(tmp_path / "step-2", checkpoint(2))
        assert [path.name for path in tmp_path.iterdir()] == ["step-1"]
    assert latest_checkpoint(tmp_path, "step").name == "step-1"


@lean_kernel
def doubled(number):
    return 2 * number


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """A folder of kernels of its own, and what is said of it."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "kernels"))
    said = []
    monkeypatch.setattr(announcement, "explain_not_kept", lambda folder, error: said.append(error))
    return tmp_path / "kernels", said


def test_kernels_work_on_a_full_disk_and_leave_no_half_file(kernels):
    folder, said = kernels
    with files_of_at_most(1000):
        assert doubled(1.5) == 3.0
    assert said and not [path for path in folder.rglob("*") if path.is_file()]


@needs_proc
@pytest.mark.parametrize("variable", ["HOME", "XDG_CACHE_HOME"])
def test_kernels_work_without_a_home_and_without_a_cache_that_can_be_written(kernels, monkeypatch, variable):
    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv(variable, str(UNWRITABLE))
    number = {"HOME": 3, "XDG_CACHE_HOME": 4 + 0j}[variable]  # types that nothing was compiled for
    assert doubled(number) == 2 * number
    assert len(kernels[1]) == 1
