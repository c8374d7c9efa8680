"""The checkers of Gymnasium and PettingZoo pass with the base install, without any extra."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
BASE = ("numpy", "numba", "scipy", "gymnasium", "pettingzoo", "pillow")
CHECK = """
import sys

class NotInstalled:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in %r:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, NotInstalled())

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, render_test, seed_test

import entropy_explore_env as package

BOX = "box-7x11x5"
single = gymnasium.make(package.environment_id(BOX))
assert single.spec.max_episode_steps == 20001 and single.spec.reward_threshold == 0.8
check_env(single.unwrapped)
parallel_api_test(package.parallel_env(BOX, max_cycles=8), num_cycles=10)
parallel_seed_test(lambda: package.parallel_env(BOX, max_cycles=8))
api_test(package.env(BOX, max_cycles=8), num_cycles=10)
seed_test(lambda: package.env(BOX, max_cycles=8))
render_test(lambda render_mode=None: package.env(BOX, render_mode=render_mode))
assert package.EntropyExploreEnv.metadata["render_modes"] == ["rgb_array"]
with pytest.raises(package.MissingExtraError, match="render"):
    package.parallel_env(BOX, render_mode="human").reset(seed=0)
"""


def extras() -> set[str]:
    """Modules of packages that only extras bring."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8").partition("[project.optional-dependencies]")
    names = set(re.findall(r'"([A-Za-z0-9_.-]+?)(?:\[|>|;|")', text[2].partition("[tool.")[0])) - set(BASE)
    modules = {"pygame", "yaml", "octomap", "rerun", "cpuinfo", "sklearn", "pandas", "cv2", "moviepy"}
    return modules | {name.replace("-", "_") for name in names} - {"entropy_explore_env", "pytest"}


def test_checkers_pass_without_extras() -> None:
    script = CHECK % (extras(),)
    assert {"matplotlib", "torch", "trimesh", "docstring_parser", "stable_baselines3", "pygame"} <= extras()
    command = [sys.executable, "-W", "ignore", "-c", script]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
