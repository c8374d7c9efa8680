"""Without its extra, a command of training says in one line what to install."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WITHOUT = """
import importlib.util, runpy, sys
find = importlib.util.find_spec
importlib.util.find_spec = lambda name, *more: None if name == "torch" else find(name, *more)


class Absent:
    def find_spec(self, name, *more):
        if name == "torch":
            raise ModuleNotFoundError(name)


sys.meta_path.insert(0, Absent())
sys.argv = ["ppo"]
runpy.run_module({module!r}, run_name="__main__", alter_sys=True)
"""


@pytest.mark.parametrize("module", ["training.ppo", "training.evaluate", "training.map_predictor"])
def test_what_is_missing_is_one_line_that_names_the_cpu_build_first(module):
    ran = subprocess.run(
        [sys.executable, "-c", WITHOUT.format(module=module)], cwd=ROOT, capture_output=True, text=True
    )
    assert ran.returncode == 2 and ran.stdout == ""
    assert ran.stderr.startswith("error: torch is not installed: pip install torch --index-url https://")
    assert "for CUDA: pip install torch" in ran.stderr and ran.stderr.count("\n") == 1
