"""Compiled code on disk is that of the sources as a process imported them, wherever kernels are and call."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import NumbaError

from entropy_explore_env.compilation.kernels import lean_kernel
from tests.systems import needs_posix

LEAF = """import numpy as np
from entropy_explore_env.compilation.kernels import {decorator}

CONSTANT = {constant}


@{decorator}
def leaf(x):
    return x + CONSTANT
"""
CALLER = """
from entropy_explore_env.compilation.kernels import lean_kernel
from {package}.leaf import leaf


@lean_kernel
def caller(x):
    return leaf(x)
"""
CALL = "from entropy_explore_env.compilation.announcement import compiled_kernels\n"
CALL += "from {package}.caller import caller; print(caller(1.0), len(compiled_kernels()))"
ROOT = Path(__file__).parents[2]


def package(folder: Path, name: str = "mine", constant: str = "10.0", decorator: str = "lean_kernel") -> Path:
    made = folder / name
    made.mkdir(parents=True, exist_ok=True)
    (made / "__init__.py").write_text("")
    (made / "leaf.py").write_text(LEAF.format(constant=constant, decorator=decorator))
    (made / "caller.py").write_text(CALLER.format(package=name))
    return made


def start(code: str, folder: Path, **environment: str | None) -> subprocess.Popen[str]:
    named = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    named |= {"PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)]), **environment}
    kept = {name: value for name, value in named.items() if value is not None}
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [sys.executable, "-c", code], env=kept, stdin=pipe, stdout=pipe, stderr=pipe, text=True, cwd=folder
    )


def run(code: str, folder: Path, **environment: str | None) -> str:
    process = start(code, folder, **environment)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out.strip()


def kernels(folder: Path) -> set[str]:
    return {file.name for file in folder.rglob("*.kernel")}


@pytest.mark.parametrize("decorator", ["lean_kernel", "inlined_kernel", "kernel"])
def test_a_kernel_changes_when_one_that_it_calls_changes_and_only_then(tmp_path, decorator):
    call = CALL.format(package="mine")
    package(tmp_path, decorator=decorator)
    assert run(call, tmp_path) == "11.0 1"
    assert run(call, tmp_path) == "11.0 0"  # from disk
    leaf = package(tmp_path, constant="20.0", decorator=decorator) / "leaf.py"
    assert run(call, tmp_path) == "21.0 1"
    leaf.write_text("# what it is for\n\n\n" + leaf.read_text())
    assert run(call, tmp_path) == "21.0 0"
    package(tmp_path, constant="10.0", decorator=decorator)
    assert run(call, tmp_path) == "11.0 0"  # what was compiled first is still there


@needs_posix
def test_nothing_is_written_into_packages(tmp_path):
    """In a test folder, and where a package cannot be written; the user's cache folder takes it all."""
    for name, mode in (("tests_of_mine", 0o755), ("installed", 0o555)):
        made = package(tmp_path, name)
        made.chmod(mode)
        before = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.py")}
        home = tmp_path / f"home of {name}"
        environment = {"NUMBA_CACHE_DIR": None, "XDG_CACHE_HOME": None, "HOME": str(home)}
        environment |= {"LOCALAPPDATA": str(home)}
        assert run(CALL.format(package=name), tmp_path, **environment) == "11.0 1"
        assert {file.name for file in made.iterdir()} == {"__init__.py", "leaf.py", "caller.py"}
        assert {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.py")} == before
        assert len(kernels(home)) == 2  # the caller for Python, the leaf for the caller
        made.chmod(0o755)
        package(tmp_path, name, constant="20.0")
        made.chmod(mode)
        assert run(CALL.format(package=name), tmp_path, **environment) == "21.0 1"
        made.chmod(0o755)


def test_a_long_run_keeps_the_code_that_it_imported(tmp_path):
    """It compiles after an edit on disk; what it writes is not taken for the code of the new file."""
    made = package(tmp_path)
    late = "from mine.caller import caller\nprint('imported', flush=True)\ninput()\nprint(caller(1.0))"
    process = start(late, tmp_path)
    assert process.stdout is not None and process.stdout.readline() == "imported\n"
    package(tmp_path, constant="20.0")
    assert (made / "leaf.py").read_text().count("20.0") == 1
    out, err = process.communicate("\n", timeout=120)
    assert (process.returncode, out) == (0, "11.0\n"), err
    assert run(CALL.format(package="mine"), tmp_path) == "21.0 1"
    package(tmp_path, constant="10.0")
    assert run(CALL.format(package="mine"), tmp_path) == "11.0 0"


def test_where_nothing_can_be_written_kernels_work_and_one_line_says_so(tmp_path):
    package(tmp_path)
    (tmp_path / "file").write_text("not a folder")
    code = CALL.format(package="mine") + "\nprint(caller(1))"
    process = start(code, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "file"))
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out) == (0, "11.0 1\n11.0\n"), err
    assert err.count("are not kept") == 1 and "NUMBA_CACHE_DIR" in err and "Traceback" not in err


def test_processes_may_compile_the_same_at_once(tmp_path):
    package(tmp_path)
    call = "from mine.caller import caller; print(caller({}), caller({}))"
    processes = [
        start(call.format(*pair), tmp_path) for pair in (("1.0", "1"), ("1", "1.0"), ("1.0", "True"))
    ]
    outs = [process.communicate(timeout=120) for process in processes]
    assert [out for out, _ in outs] == ["11.0 11.0\n"] * 3, outs
    assert not list(tmp_path.rglob("*.part")) and not list(tmp_path.rglob("*.claim"))
    assert len(kernels(tmp_path)) == 6  # for three types, the caller and the leaf
    assert run(call.format("1", "1.0"), tmp_path) == "11.0 11.0"


def test_a_damaged_file_is_compiled_anew(tmp_path):
    package(tmp_path)
    call = CALL.format(package="mine")
    assert run(call, tmp_path) == "11.0 1"
    (file,) = tmp_path.rglob("mine.caller.caller-*.kernel")
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    assert run(call, tmp_path) == "11.0 1"
    assert run(call, tmp_path) == "11.0 0"


def test_a_lean_kernel_makes_no_array():
    @lean_kernel
    def careless():
        return np.zeros(3)

    with pytest.raises(NumbaError, match="Only accept returning of array passed into the function"):
        careless()


INTERPRETED = """
import numpy as np
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.state_digest import state_digest
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX

missions = Missions(with_settings(BOX, {"robots": 3, "world": "furnished", "track_truth": True,
    "channel": {"delay_s": 1.0, "loss_probability": 0.2}, "sensor": {"scan_every_m": 0.3},
    "robot": {"navigator": "planned", "redecide": "on_scan"}}))
missions.reset(0, 0)
rng = np.random.default_rng(0)
for _ in range(12):
    missions.step(rng.uniform(-1.0, 1.0, (1, 3, 5)), np.zeros((1, 3), np.int64))
print(state_digest(missions, 0))
"""


def test_interpreted_kernels_give_the_bits_of_compiled_ones():
    digests = set()
    for disabled in ("0", "1"):
        ran = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", INTERPRETED],
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
            capture_output=True,
            text=True,
            check=True,
        )
        digests.add(ran.stdout)
    assert len(digests) == 1 and len(next(iter(digests))) == 65
