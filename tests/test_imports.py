"""Imports run one way and never to the truth: the contracts of pyproject, kept and broken, and the rest."""

from __future__ import annotations

import ast
import re
import shutil
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
WRONG_IMPORTS = {
    f"{LIBRARY}.belief.raycast": (f"{LIBRARY}.belief.map_update", f"{LIBRARY}.robots.motion"),
    f"{LIBRARY}.belief.paths.lattice": (f"{LIBRARY}.belief.paths.planning",),
    f"{LIBRARY}.robots.channel": (f"{LIBRARY}.robots.motion", "pettingzoo"),
    f"{LIBRARY}.missions.rules": (f"{LIBRARY}.missions.tick", "torch"),
    f"{LIBRARY}.reports.colours": (f"{LIBRARY}.envs.infos", "stable_baselines3"),
    f"{LIBRARY}.settings.scenario": (f"{LIBRARY}.settings.scenarios", "tests.reference"),
    f"{LIBRARY}.worlds.recipes.plan": (f"{LIBRARY}.worlds.load", f"{LIBRARY}.worlds.recipes.cave"),
    f"{LIBRARY}.worlds.recipes.cave": (f"{LIBRARY}.worlds.recipes.office",),
    f"{LIBRARY}.worlds.files.voxels": (f"{LIBRARY}.worlds.files.worker", f"{LIBRARY}.worlds.world"),
    f"{LIBRARY}.worlds.files.images": (f"{LIBRARY}.writing", f"{LIBRARY}.worlds.files.process"),
    f"{LIBRARY}.envs.infos": (LIBRARY, f"{LIBRARY}.envs.robot_vec_env", "baselines.run"),
    "baselines.strategies.rules.gradient": (
        f"{LIBRARY}.missions.simulation",
        "baselines.papers.rocha04.sweep",
    ),
    "baselines.papers.rocha04.sweep": ("baselines.papers.rochami.sweep", "training.policy"),
    "training.policy": (f"{LIBRARY}.worlds.load", f"{LIBRARY}.robots.channel", "benchmarks.speed"),
}
"""Importer → what it may not import."""


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


@pytest.fixture(scope="module")
def complaints(tmp_path_factory) -> list[str]:
    """What the contracts say of a copy of the checkout with all wrong imports in it."""
    copy = tmp_path_factory.mktemp("checkout")
    shutil.copy(ROOT / "pyproject.toml", copy)
    for package in PACKAGES:
        shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__", "*.nb?"))
    for importer, targets in WRONG_IMPORTS.items():
        with copy.joinpath(*importer.split(".")).with_suffix(".py").open("a") as file:
            file.writelines(f"def _():\n    import {target}\n" for target in targets)
    (copy / LIBRARY / "belief" / "placeless.py").write_text("")
    done = check_contracts(copy)
    assert done.returncode == 1, done.stderr
    broken = done.stdout.split("Broken contracts")[1]
    return re.findall(r"^ *- +([\w.]+(?: -> [\w.]+)?)", broken, flags=re.MULTILINE)


@pytest.mark.parametrize(
    "wrong", [f"{importer} -> {target}" for importer, targets in WRONG_IMPORTS.items() for target in targets]
)
def test_a_wrong_import_breaks_a_contract(complaints, wrong):
    wrong = wrong.replace("tests.reference", "tests")  # of what is not a package of ours, the first name
    assert wrong in complaints


def test_a_file_without_a_place_breaks_a_contract(complaints):
    assert f"{LIBRARY}.belief.placeless" in complaints


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
    makes_files = "pack_worlds.py"  # a command that saves the suites' worlds: nothing that acts imports it
    files = sorted(path for path in (ROOT / folder).rglob("*.py") if path.name != makes_files)
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
