"""Compiled code on disk is forgotten as soon as a source file that it may come from changes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import NumbaError

from entropy_explore_env.compilation.kernels import forget_stale_kernels, lean_kernel

LEAF = """from entropy_explore_env.compilation.kernels import inlined_kernel


@inlined_kernel
def leaf(x):
    return x + {}
"""
CALLER = """import pathlib

import entropy_explore_env.compilation.kernels as compilation

compilation.forget_stale_kernels(pathlib.Path(__file__).parent)
from kernels.leaf import leaf


@compilation.lean_kernel
def caller(x):
    return leaf(x)


print(caller(1.0))
"""


def answer(folder: Path) -> str:
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    paths = os.pathsep.join([str(folder), str(Path(__file__).parents[2])])
    command = [sys.executable, "-c", "import kernels.caller"]
    done = subprocess.run(
        command, env={**environment, "PYTHONPATH": paths}, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_a_kernel_is_compiled_anew_when_one_that_it_calls_changes(tmp_path):
    package = tmp_path / "kernels"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "leaf.py").write_text(LEAF.format("10.0"))
    (package / "caller.py").write_text(CALLER)
    assert answer(tmp_path) == "11.0"
    assert list(package.rglob("*.nbi"))
    (package / "leaf.py").write_text(LEAF.format("20.0"))
    assert answer(tmp_path) == "21.0"


def test_nothing_is_dropped_while_nothing_changes(tmp_path):
    package, other = tmp_path / "kernels", tmp_path / "other"
    index = package / "__pycache__" / "caller.nbi"
    index.parent.mkdir(parents=True)
    other.mkdir()
    (package / "caller.py").write_text("")
    forget_stale_kernels(package, other)
    index.write_bytes(b"compiled")
    forget_stale_kernels(package, other)
    assert index.exists()
    (other / "leaf.py").write_text("")  # a package that it builds on
    forget_stale_kernels(package, other)
    assert not index.exists()


def test_a_lean_kernel_makes_no_array():
    @lean_kernel
    def careless():
        return np.zeros(3)

    with pytest.raises(NumbaError, match="Only accept returning of array passed into the function"):
        careless()


def test_compiled_code_has_a_file_of_its_own(tmp_path):
    """Two processes that save at the same time must not write to one file: none is a number alone."""
    package = tmp_path / "kernels"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "leaf.py").write_text(LEAF.format("10.0"))
    (package / "caller.py").write_text(CALLER + "print(caller(1))\n")
    assert answer(tmp_path) == "11.0\n11.0"
    files = [file.name for file in package.rglob("*.nbc") if ".caller-" in file.name]
    assert len(files) == 2 and len({name.split(".")[0] for name in files}) == 2
    assert answer(tmp_path) == "11.0\n11.0"
    assert sorted(files) == sorted(file.name for file in package.rglob("*.nbc") if ".caller-" in file.name)
