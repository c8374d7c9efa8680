"""`python -m entropy_explore_env`: the version, and what the doctor finds."""

from __future__ import annotations

import importlib
import json
import re
from pathlib import Path

import pytest
from numba.core import config

from entropy_explore_env import __version__, doctor
from entropy_explore_env.__main__ import main
from entropy_explore_env.command import run_command

ROOT = Path(__file__).parents[1]


def test_the_version(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0 and capsys.readouterr().out == f"entropy_explore_env {__version__}\n"


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


def test_what_is_not_installed_is_said(monkeypatch):
    monkeypatch.setattr(doctor, "EXTRAS", {"one": ("no-such-package",), "two": ("numpy", "no-such-package")})
    said = doctor.report(doctor.findings())
    assert "extra one: not installed" in said and re.search(r"extra two: numpy [\d.]+; lacks no-", said)


def test_console_scripts_name_functions():
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    scripts = re.findall(r'^entropy-explore-\w+ = "([\w.]+):(\w+)"$', project, flags=re.MULTILINE)
    assert len(scripts) == 4
    assert all(callable(getattr(importlib.import_module(module), name)) for module, name in scripts)
