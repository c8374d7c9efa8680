"""Branches that tests take: files of tests one by one, a row a source file, named errors."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest

from benchmarks.reliability import coverage
from benchmarks.reliability.coverage import ROOT
from benchmarks.reliability.quick_tests import LIMIT, TOLD, Told, told_in
from entropy_explore_env.errors import SettingError


def summary(branches, covered):
    counts = {"num_branches": branches, "covered_branches": covered}
    return {"summary": counts, "missing_branches": [[3, 7]] if covered < branches else []}


def row(name, covered, files=2):
    path = f"entropy_explore_env/{name}.py"
    return {"path": path, "branches": 4, "covered": covered, "files": files, "of_files": 2, "test_s": 2.5}


def test_rows_of_other_folders_stay_and_files_without_branches_are_left_out(tmp_path, monkeypatch, capsys):
    report = {
        "files": {
            "entropy_explore_env/belief/b.py": summary(4, 3),
            "entropy_explore_env/belief/a.py": summary(0, 0),
            "entropy_explore_env/robots/x.py": summary(4, 0),
        }
    }
    monkeypatch.setattr(coverage, "test_files", lambda root, folders: ["tests/a.py", "tests/b.py"])
    monkeypatch.setattr(coverage, "measure", lambda file, kept, test_s: touch(coverage.data_of(file, kept)))
    monkeypatch.setattr(coverage, "report_of", lambda data: report)
    out, where = tmp_path / "coverage.jsonl", ["--kept", str(tmp_path / "kept")]
    rows = [row("belief/x", 1), row("robots/x", 1)]
    out.write_text("".join(json.dumps(each) + "\n" for each in rows))
    words = ["--folders", "belief", "--test-s", "2.5", "--out", str(out), *where]
    assert coverage.main([*words, "--missing"]) == 0
    assert [json.loads(line) for line in out.read_text().splitlines()] == [rows[1], row("belief/b", 3)]
    said = capsys.readouterr().out
    assert "belief/b.py: 3 of 4" in said and "belief/b.py:3 -> 7" in said and "2 of 2 files" in said
    assert coverage.main([*words, "--kept", str(tmp_path / "none"), "--limit-s", "0"]) == 0
    assert json.loads(out.read_text().splitlines()[-1]) == row("belief/b", 3, files=0)
    with pytest.raises(SettingError, match="one of belief, robots"):
        coverage.main(["--folders", "worlds"])


def touch(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()


def test_a_file_of_tests_is_measured_once_with_the_names_of_its_tests(tmp_path):
    file = "tests/belief/paths/test_bucket_queue.py"
    coverage.measure(file, tmp_path, 10.0)
    data = coverage.data_of(file, tmp_path)
    told = told_in(data.with_suffix(".tests"))
    assert told and all(test.name.startswith(f"{file}::test_") and test.seconds < 10.0 for test in told)
    rows = {each["path"]: each for each in coverage.rows_of(coverage.report_of([data]))}
    queue = rows["entropy_explore_env/belief/paths/bucket_queue.py"]
    assert 0 < queue["covered"] <= queue["branches"]
    before = data.stat()
    coverage.measure(file, tmp_path, 10.0)
    assert data.stat() == before


def test_few_examples_are_drawn_where_kernels_are_interpreted(tmp_path):
    shutil.copy(ROOT / "tests" / "conftest.py", tmp_path)
    (tmp_path / "test_it.py").write_text(
        "from hypothesis import given, settings, strategies as st\nseen = []\n"
        "@given(st.integers())\ndef test_drawn(number):\n    seen.append(number)\n"
        "def test_few():\n    assert 1 < len(seen) <= 10 and settings.default.deadline is None\n"
    )
    words = ["-q", "-p", "no:cacheprovider", "-p", "benchmarks.reliability.quick_tests", "test_it.py"]
    variables = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-m", "pytest", *words], cwd=tmp_path, env=variables, check=True)


def test_a_test_that_waits_for_ever_is_ended(tmp_path):
    (tmp_path / "test_it.py").write_text(
        "import threading\ndef test_waits():\n    threading.Semaphore(0).acquire()\n"
        "def test_next():\n    pass\n"
    )
    words = ["-q", "-p", "no:cacheprovider", "-p", "benchmarks.reliability.quick_tests", "test_it.py"]
    variables = {**os.environ, "PYTHONPATH": str(ROOT), LIMIT: "0.03", TOLD: "told"}
    subprocess.run([sys.executable, "-m", "pytest", *words], cwd=tmp_path, env=variables, timeout=60)
    assert [told.passed for told in told_in(tmp_path / "told")] == [False, True]


def test_what_coverage_notes_is_noted_before_a_test_is_ended(tmp_path):
    """Its clock rings while coverage holds its lock: the lock is given back, and then the test ends."""
    (tmp_path / "test_it.py").write_text(
        "import threading, time, types\nlock = threading.Lock()\n"
        "noting = types.ModuleType('coverage.collector')\n"
        "exec('def note(lock, wait):\\n with lock:\\n  wait()', vars(noting))\n"
        "def busy():\n    until = time.process_time() + 0.2\n"
        "    while time.process_time() < until:\n        pass\n"
        "def test_noting():\n    noting.note(lock, busy)\n    busy()\n"
        "def test_next():\n    assert lock.acquire(blocking=False)\n"
    )
    words = ["-q", "-p", "no:cacheprovider", "-p", "benchmarks.reliability.quick_tests", "test_it.py"]
    variables = {**os.environ, "PYTHONPATH": str(ROOT), LIMIT: "0.05", TOLD: "told"}
    subprocess.run([sys.executable, "-m", "pytest", *words], cwd=tmp_path, env=variables, timeout=60)
    noting, then = told_in(tmp_path / "told")
    assert (noting.passed, then.passed) == (False, True)
    assert 0.2 <= noting.seconds < 0.35


def test_what_is_told_of_tests_is_read_back(tmp_path):
    (tmp_path / "told").write_text("passed\t0.25\ta::b[c\td]\nfailed\t1.5\ta::e\n")
    assert told_in(tmp_path / "told") == [Told("a::b[c\td]", True, 0.25), Told("a::e", False, 1.5)]
    assert told_in(tmp_path / "none") == []


def test_other_sources_are_measured_anew(tmp_path):
    (tmp_path / "entropy_explore_env" / "belief").mkdir(parents=True)
    source = tmp_path / "entropy_explore_env" / "belief" / "a.py"
    source.write_text("1")
    before = coverage.sources_digest(tmp_path)
    source.write_text("2")
    assert coverage.sources_digest(tmp_path) != before and len(before) == 12
