"""Type checkers know the settings that environments take, and find the package in an editable install."""

import json
import subprocess
import sys
import typing
import zipfile
from dataclasses import fields
from pathlib import Path

import pytest

from entropy_explore_env import Scenario
from entropy_explore_env.envs.keywords import ScenarioSettings

ROOT = Path(__file__).parents[2]
GOOD = """
from entropy_explore_env import EntropyExploreVectorEnv, SingleRobotEnv, env, load_world, parallel_env
from entropy_explore_env.settings.channel import Channel

team = parallel_env("room", robots=3, channel={"burst": 32}, max_cycles=None, decision_period_s=None)
turns = env("office", track_truth=True, world="map.png")
batch = EntropyExploreVectorEnv("room", 4, channel=Channel(burst=8), time_limit_s=60.0)
alone = SingleRobotEnv("room", split="test")
world = load_world("map.png", 0.1, height_m=2.5)
more = {"robots": 2, "reward": {"kind": "team"}}
"""
BAD = (
    'parallel_env("room", robts=3)',
    'env("room", channels={"burst": 3})',
    'EntropyExploreVectorEnv("room", 4, robots="3")',
    'SingleRobotEnv("room", split="tests")',
    'parallel_env("room", decision_period_s="1")',
    'load_world("map.png", heigth_m=2.5)',
)


def test_the_settings_for_type_checkers_are_those_of_a_scenario() -> None:
    known = set(typing.get_type_hints(ScenarioSettings))
    assert known == {field.name for field in fields(Scenario)} | {"max_cycles", "time_limit_s"}


def test_a_type_checker_takes_what_is_right_and_finds_what_is_wrong(tmp_path: Path) -> None:
    pyright = pytest.importorskip("pyright", reason="pyright is not installed")
    assert pyright
    first_bad = GOOD.count("\n") + 1
    (tmp_path / "mine.py").write_text(GOOD + "\n".join(BAD) + "\n")
    settings = {"include": ["mine.py"], "extraPaths": [str(ROOT)], "pythonVersion": "3.10"}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    command = [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    found = json.loads(done.stdout)["generalDiagnostics"]
    wrong = {each["range"]["start"]["line"] + 1 for each in found if each["severity"] == "error"}
    assert wrong == set(range(first_bad, first_bad + len(BAD))), found


def test_an_editable_install_is_a_path_which_type_checkers_follow(tmp_path: Path) -> None:
    pytest.importorskip("setuptools", minversion="77.0.3", reason="setuptools is not installed")
    build = "import sys; from setuptools import build_meta; print(build_meta.build_editable(sys.argv[1]))"
    command = [sys.executable, "-c", build, str(tmp_path)]
    subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        paths = [wheel.read(name).decode().strip() for name in wheel.namelist() if name.endswith(".pth")]
    assert paths == [str(ROOT)]
