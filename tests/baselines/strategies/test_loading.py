"""Strategies from outside the package: by file, by module and by entry point, in every command."""

from __future__ import annotations

import importlib.metadata
import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import STRATEGIES, make_strategy, strategy_module
from baselines.strategies.rules.gradient import GradientStrategy
from entropy_explore_env.errors import ActionError, SettingError
from entropy_explore_env.planner.frontier_rule import PickRule
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX
from tests.code_blocks import shown_files

ROOT = Path(__file__).parents[3]
EXAMPLE, SECOND_NEAREST, ITS_TEST = (
    ROOT / f"docs/examples/{name}.py" for name in ("own_strategy", "second_nearest", "test_second_nearest")
)
SOURCE = """
class Own:
    def reset(self, scenario, rng): pass
    def choose(self, view): return view.pose

class Deaf:
    def reset(self, scenario, rng): pass

class Needy(Own):
    def __init__(self, colour): pass

class Broken(Own):
    def __init__(self): raise RuntimeError("no\\nway")

def settings(): return Own()
NUMBER = 3
"""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "mine.py").write_text(SOURCE)
    return tmp_path / "mine.py"


def command(folder, *words):
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{folder}"}
    ran = subprocess.run(
        [sys.executable, "-m", *words], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


def test_the_example_runs_and_is_benchmarked_from_a_folder_outside(tmp_path):
    (tmp_path / "own_strategy.py").write_text(EXAMPLE.read_text())
    by_file, by_module = "own_strategy.py:NearestUnknown", "own_strategy:NearestUnknown"
    limit = "--ending.time-limit-s", "6"
    ran = command(
        tmp_path, "baselines.run", "box-7x11x5", "--strategy", by_file, *limit, "--json", "--robots", "2"
    )
    assert ran["strategy"] == by_file and ran["scans"] > 2
    assert ran["entropy_end_bits"] < ran["entropy_start_bits"] and ran["blocked_moves"] <= ran["scans"]
    entries = "--scenarios", "box-7x11x5", "--strategies", f"{by_file},{by_module}"
    sizes = "--robots", "2", "--seeds", "1", "--time-limit-s", "6", "--jobs", "2"
    command(tmp_path, "baselines.benchmark", *entries, *sizes, "--json", "--out", "out")
    kept = (tmp_path / "out/runs/own.jsonl").read_text().splitlines()
    assert len(kept) == 3  # each class, and random
    assert all(name in (tmp_path / "out/own.md").read_text() for name in (by_file, by_module))


def test_the_page_shows_the_example_as_it_is():
    assert {EXAMPLE, SECOND_NEAREST, ITS_TEST} <= set(shown_files())
    assert len(EXAMPLE.read_text().splitlines()) <= 30 and len(SECOND_NEAREST.read_text().splitlines()) <= 12


def test_a_class_and_a_function_of_a_file_are_made(file):
    assert type(make_strategy(f"{file}:Own")).__name__ == "Own"
    assert type(make_strategy(f"{file}:settings")) is type(make_strategy(f"{file}:Own"))  # imported once


@pytest.mark.parametrize("robots", [1, 2])
def test_a_function_of_one_argument_is_a_rule(robots):
    strategy = make_strategy(f"{SECOND_NEAREST}:pick")
    assert isinstance(strategy, PickRule) and strategy.rule == "pick"
    env = scripted_env(with_settings(BOX, {"robots": robots, "ending": {"time_limit_s": 20.0}}))
    run_mission(env, strategy, 0)
    state = env.missions.state
    assert state.missions[0]["entropy_end_bits"] < state.missions[0]["entropy_start_bits"]
    assert (state.robots[0]["distance_m"] > 0.5).all()


def test_the_test_that_the_page_shows_passes(monkeypatch):
    monkeypatch.syspath_prepend(SECOND_NEAREST.parent)
    shown = {name: value for name, value in runpy.run_path(str(ITS_TEST)).items() if name.startswith("test_")}
    assert len(shown) == 1
    for test in shown.values():
        test()


@pytest.mark.parametrize("picked", ["-7", "10**9", "2.5", "None", "True"])
def test_what_a_rule_returns_must_be_a_voxel(file, picked):
    (file.parent / "rule.py").write_text(f"def mine(scene, extra=0): return {picked}\n")
    strategy = make_strategy(f"{file.parent}/rule.py:mine")
    with pytest.raises(ActionError, match="pick of mine"):
        run_mission(scripted_env(with_settings(BOX, {"robots": 1})), strategy, 0)


def test_a_file_imports_its_neighbours(file, monkeypatch):
    monkeypatch.setattr(sys, "path", sys.path.copy())
    (file.parent / "beside.py").write_text("from mine import Own\nclass Beside(Own): pass\n")
    assert type(make_strategy(f"{file.parent}/beside.py:Beside")).__name__ == "Beside"


def test_an_entry_point_is_a_name(monkeypatch):
    declared = importlib.metadata.EntryPoint(
        "uphill", "baselines.strategies.rules.gradient:GradientStrategy", "entropy_explore_env.strategies"
    )
    found = {"entropy_explore_env.strategies": (declared,)}
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found.get(group, ()))
    assert isinstance(make_strategy("uphill"), GradientStrategy)
    assert strategy_module("uphill") == "baselines.strategies.rules.gradient"
    with pytest.raises(SettingError, match=r"did you mean uphill\?"):
        make_strategy("uphil")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gradeint", "did you mean gradient?"),
        ("nonsense", "one of random, gradient"),
        ("runs/nothing", "there is no such folder"),
        ("no_such_module:Own", "there is no module no_such_module"),
        ("baselines.strategies.nothing:Own", "there is no module baselines.strategies.nothing"),
        ("baselines:", "module:Class or path/to/file.py:Class"),
        ("no way:Own", "neither a module's name nor a .py file"),
        ("nowhere.py:Own", "there is no file nowhere.py"),
        ("{file}:Nothing", "such as Broken, Needy, Own (Nothing is none)"),
        ("{file}:NUMBER", "NUMBER is none"),
        ("{file}:Deaf", "choose missing"),
        ("{file}:Needy", "TypeError"),
        ("{file}:Broken", "Broken() raised RuntimeError: no way"),
        ("{syntax}:Own", "code that can be imported (SyntaxError"),
        ("{lacking}:Own", "No module named 'no_such_thing'"),
    ],
)
def test_what_is_refused_says_why_in_one_line(file, name, said):
    (file.parent / "syntax.py").write_text("class Own(:\n")
    (file.parent / "lacking.py").write_text("import no_such_thing\n")
    name = name.format(file=file, syntax=file.parent / "syntax.py", lacking=file.parent / "lacking.py")
    with pytest.raises(SettingError) as raised:
        make_strategy(name)
    assert raised.value.field == "strategy" and said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_where_strategies_are_defined(file):
    assert strategy_module("gradient-plane") == "baselines.strategies.rules.gradient"
    assert strategy_module(f"{file}:Own") == file.resolve()
    assert strategy_module("my_package.mine:Own") == "my_package.mine"
    rooms = ("baselines.strategies.", "entropy_explore_env.planner.", "entropy_explore_env.explorer")
    assert all(str(strategy_module(name)).startswith(rooms) for name in STRATEGIES)
