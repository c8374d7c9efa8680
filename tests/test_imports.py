"""Imports run one way and never to the truth: the contracts of pyproject, kept and broken, and the rest."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LIBRARY = "entropy_explore_env"
PACKAGES = (LIBRARY, "baselines", "training", "benchmarks")
TRUTH = ("Missions", "World", "load_octomap", "load_world", "save_world")
"""Public names that show the truth: not for strategies."""
HEAVY = (*PACKAGES[1:], "tests", "torch", "matplotlib", "stable_baselines3", "ray")
"""What importing the library never loads, nor what only some need."""
FOR_SOME = ("pygame", "av", "rerun", "octomap", "docstring_parser", "rich", "tensorboard", "pandas")


def check_contracts(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run pyproject's contracts over the packages in `folder`."""
    script = "import sys; from importlinter.cli import lint_imports_command as lint; lint(['--no-cache'])"
    return subprocess.run(
        [sys.executable, "-c", script],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={"COLUMNS": "500"},
    )


def test_the_contracts_are_kept():
    done = check_contracts(ROOT)
    assert done.returncode == 0, done.stdout[done.stdout.find("Contracts:") :] + done.stderr
    assert " 0 broken." in done.stdout


def test_a_folder_of_the_library_has_an_init_of_one_sentence():
    for file in (ROOT / LIBRARY).glob("*/**/__init__.py"):
        tree = ast.parse(file.read_text())
        assert len(tree.body) == 1, f"{file} holds more than a docstring"
        assert (ast.get_docstring(tree) or "").count(".") >= 1, f"{file} has no sentence"


def test_importing_the_library_loads_nothing_heavy():
    script = f"import sys, {LIBRARY}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    loaded = {name.split(".")[0] for name in done.stdout.split()}
    assert not loaded & {*HEAVY, *FOR_SOME}
    assert "pettingzoo" in loaded


def truth_reached_by(source: str) -> list[str]:
    """Names of the truth that a file imports from anywhere in the library, or reads off its public names."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == LIBRARY:
            found += [alias.name for alias in node.names if alias.name in TRUTH]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id == LIBRARY and node.attr in (*TRUTH, "missions", "worlds"):
                found.append(node.attr)
    return found


@pytest.mark.parametrize("folder", ["baselines", "training"])
def test_strategies_do_not_reach_the_truth_through_public_names(folder):
    files = sorted((ROOT / folder).rglob("*.py"))
    assert len(files) > 10
    assert {str(file): names for file in files if (names := truth_reached_by(file.read_text()))} == {}


@pytest.mark.parametrize(
    ("source", "names"),
    [
        (f"from {LIBRARY} import Missions, ROOM", ["Missions"]),
        (f"def f():\n    from {LIBRARY}.envs.parallel_env import World as W", ["World"]),
        (f"import {LIBRARY}\n{LIBRARY}.missions.simulation.Missions(1)", ["missions"]),
        (f"import {LIBRARY}\n{LIBRARY}.load_world('a.bt')", ["load_world"]),
        (f"import {LIBRARY}\n{LIBRARY}.parallel_env(world='a.bt')", []),
    ],
)
def test_the_truth_is_found_however_it_is_reached(source, names):
    assert truth_reached_by(source) == names


@pytest.mark.parametrize("name", ["rocha04", "rochami", "sawhney"])
def test_the_reference_imports_nothing_of_the_library(name):
    """Otherwise it would share the mistakes that it is there to find."""
    tree = ast.parse((ROOT / "tests" / "reference" / f"{name}.py").read_text())
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert "math" in imported
    assert not {each.split(".")[0] for each in imported} & {*PACKAGES}
