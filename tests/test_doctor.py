"""`python -m entropy_explore_env`: the version, and what the doctor finds."""

from __future__ import annotations

import importlib
import importlib.metadata
import json
import re
import sys
from pathlib import Path

import pytest
from numba.core import config

from entropy_explore_env import __version__, doctor
from entropy_explore_env.__main__ import PARTS, main
from entropy_explore_env.command import run_command

ROOT = Path(__file__).parents[1]


def test_the_version_and_the_parts(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"entropy_explore_env {__version__}\n"
    for words in ([], ["--help"]):
        assert main(words) == 0
        assert set(PARTS) <= set(capsys.readouterr().out.split())


@pytest.mark.parametrize("part", PARTS)
def test_each_part_has_its_own_help(part, capsys):
    with pytest.raises(SystemExit) as ended:
        main([part, "--help"])
    assert ended.value.code == 0 and f"python -m entropy_explore_env {part}" in capsys.readouterr().out


def test_the_doctor_counts_kernels_and_names_versions(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    folder = tmp_path / "entropy_explore_env"
    folder.mkdir()
    for name in (
        "entropy_explore_env.missions.tick.step-0a1b",
        "entropy_explore_env.belief.x.y-2",
        "baselines.a.b-3",
    ):
        (folder / f"{name}.kernel").write_bytes(b"x" * 2**19)
    assert main(["doctor", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["kernels"]["rooms"] == {
        "baselines.a": 1,
        "entropy_explore_env.belief": 1,
        "entropy_explore_env.missions": 1,
    }
    assert found["kernels"]["files"] == 3 and found["kernels"]["mebibytes"] == 1.5
    assert found["version"] == __version__ and all(found["packages"].values())
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    assert "3 files, 1.5 MiB" in said and "no problem found" in said and "extra render" in said


def test_a_folder_that_cannot_be_written_is_a_problem(tmp_path, capsys, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "file"))
    assert main(["doctor"]) == 1
    assert "problem: " in capsys.readouterr().out
    assert run_command(main, ["docter"]) == 2
    assert "doctor" in capsys.readouterr().err


def written_extras() -> dict[str, set[str]]:
    """Extra → the packages of its list in pyproject.toml, without those of other extras."""
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    part = project.split("[project.optional-dependencies]")[1].split("\n[")[0]
    part = re.sub(r"^ *#.*$", "", part, flags=re.MULTILINE)
    lists = re.findall(r"^(\w+) = \[(.*?)\]$", part, flags=re.MULTILINE | re.DOTALL)
    return {
        extra: {name for name in re.findall(r'"([\w.-]+)', names) if name != "entropy_explore_env"}
        for extra, names in lists
    }


def test_the_extras_are_those_of_the_project_but_for_its_developers():
    written, found = written_extras(), doctor.findings()["extras"]
    assert {*written} - {*found} == {"test", "dev"} and len(found) == 12
    for extra, packages in found.items():
        if sys.version_info >= (3, 11) or extra not in ("viewer", "docs"):
            assert written[extra] <= set(packages), extra
            assert written[extra] == set(packages) or extra in ("rllib", "worlds")  # extras of other packages
    assert {"cluster", "episodes", "docs", "bench", "benchmarl"} <= set(found)
    assert found["baselines"]["scikit-image"] is not None


@pytest.fixture
def metadata(monkeypatch):
    """Requirements of made-up distributions; to be filled."""
    lists: dict[str, list[str]] = {}

    def requires(name):
        if name not in lists:
            raise importlib.metadata.PackageNotFoundError(name)
        return lists[name]

    monkeypatch.setattr(importlib.metadata, "requires", requires)
    return lists


def test_what_is_not_installed_is_said(metadata):
    metadata["entropy_explore_env"] = [
        "numpy<3,>=1.26",
        'no-such-package>=1; extra == "one"',
        'numpy; extra == "two"',
        'no-such-package[fast]>=2; python_version >= "3.10" and extra == "two"',
        'scipy; python_version < "3.10" and extra == "two"',
        'numpy[all]>=1; extra == "three"',
        'entropy_explore_env[two]; extra == "three"',
        'numpy; extra == "test"',
    ]
    metadata["numpy"] = ['other-package; extra == "all"', 'third; extra == "docs"', "always-there"]
    metadata["numpy"].append('for-windows; sys_platform == "win32" and extra == "all"')
    found = doctor.findings()
    assert [*found["packages"]] == ["numpy", "llvmlite"] and [*found["extras"]] == ["one", "two", "three"]
    assert [*found["extras"]["three"]] == ["numpy", "other-package"]
    said = doctor.report(found)
    assert "extra one: not installed" in said
    assert re.search(r"extra two: numpy [\d.]+; lacks no-such-package\n", said)
    assert re.search(r"extra three: numpy [\d.]+; lacks other-package\n", said)


def test_plain_ray_is_no_rllib(metadata, monkeypatch):
    metadata["entropy_explore_env"] = ['ray[rllib]>=2.60; extra == "rllib"', 'ray>=2.60; extra == "cluster"']
    metadata["ray"] = ["click", 'no-such-tree; extra == "rllib"', 'other; extra == "tune"']
    versions = {"ray": "2.60"}
    monkeypatch.setattr(importlib.metadata, "version", lambda name: versions.get(name) or missing(name))

    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    lines = doctor.report(doctor.findings()).splitlines()
    assert "extra rllib: ray 2.60; lacks no-such-tree" in lines and "extra cluster: ray 2.60" in lines
    metadata["ray"].append('gymnasium==1.2.2; extra == "rllib"')
    for there, said in (
        ("1.4.0", "; lacks no-such-tree, gymnasium 1.2.2"),
        ("1.2.2", "; lacks no-such-tree"),
    ):
        versions["gymnasium"] = there
        lines = doctor.report(doctor.findings()).splitlines()
        assert f"extra rllib: ray 2.60, gymnasium {there}{said}" in lines


def test_a_library_that_is_not_installed_knows_no_extras(metadata):
    assert metadata == {}
    found = doctor.findings()
    assert found["extras"] == {} and "extras: not known" in doctor.report(found)


def test_the_console_script_names_a_function():
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    ((module, name),) = re.findall(r'^entropy-explore-env = "([\w.]+):(\w+)"$', project, flags=re.MULTILINE)
    assert callable(getattr(importlib.import_module(module), name))
