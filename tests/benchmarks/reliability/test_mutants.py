"""Faults put into a file: each is one change, in functions only; tests are run until one finds it."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from coverage import CoverageData

from benchmarks.reliability import fault_table, mutant_runs, mutants
from benchmarks.reliability.coverage import ROOT
from benchmarks.reliability.equivalent_faults import EQUIVALENT
from benchmarks.reliability.faults_in_source import mutants_of
from benchmarks.reliability.mutant_runs import LATE, First, Host
from benchmarks.reliability.mutants import Args, main, row_of
from benchmarks.reliability.quick_tests import SET_UP, Told
from benchmarks.reliability.reached_lines import Reached, reached_lines
from entropy_explore_env.errors import SettingError
from tests.systems import needs_posix

pytestmark = needs_posix

SOURCE = '''
"""A file."""
LIMIT = 3

def count(values, robot):
    """Count."""
    total = 0
    for value in values:
        if value < LIMIT and value != 1:
            total += value
        if ASSERTING and value > 9:
            raise AssertionError("never")
    robot.total = min(total, values[0])
    return total - 1
'''


def test_every_kind_of_fault_is_made_once_and_the_rest_stays():
    found = [mutant.what for mutant in mutants_of(SOURCE)]
    assert sorted(found) == sorted(
        [
            "total = 0  ->  total = 1",
            "if value < LIMIT and value != 1:  ->  if not (value < LIMIT and value != 1):",
            "if value < LIMIT and value != 1:  ->  if value < LIMIT or value != 1:",
            "if value < LIMIT and value != 1:  ->  if value <= LIMIT and value != 1:",
            "if value < LIMIT and value != 1:  ->  if value < LIMIT and value == 1:",
            "if value < LIMIT and value != 1:  ->  if value < LIMIT and value != 2:",
            "total += value  ->  pass",
            "total += value  ->  total -= value",
            "robot.total = min(total, values[0])  ->  pass",
            "robot.total = min(total, values[0])  ->  robot.total = max(total, values[0])",
            "return total - 1  ->  return total + 1",
            "return total - 1  ->  return total - 2",
        ]
    )
    whole = ast.unparse(ast.parse(SOURCE)).splitlines()
    for mutant in mutants_of(SOURCE):
        lines = mutant.source.splitlines()
        assert sum(one != other for one, other in zip(lines, whole, strict=True)) == 1


def test_faults_of_kernels_only_and_the_lines_of_a_statement():
    compiled = SOURCE.replace("def count", "@lean_kernel\ndef count")
    assert mutants_of(SOURCE, kernels=True) == []
    found = mutants_of(compiled, kernels=True)
    assert [mutant.what for mutant in found] == [mutant.what for mutant in mutants_of(compiled)]
    lines = compiled.splitlines()
    for mutant in found:
        assert lines[mutant.lines[0] - 1].strip().startswith(mutant.what.partition("  ->")[0][:5])
    condition = next(mutant for mutant in found if mutant.what.startswith("if value < LIMIT"))
    assert len(condition.lines) == 1


NESTED = """
@kernel
def outer(value):
    def inner(other):
        return other + 1
    return inner(value)

def around(value):
    @kernel
    def inner(other):
        return other - 1
    return inner(value + 2)
"""


def test_faults_of_functions_inside_others_are_counted_once():
    inside = ["return other + 1  ->  return other - 1", "return other + 1  ->  return other + 2"]
    compiled = [*inside, "return other - 1  ->  return other + 1", "return other - 1  ->  return other - 2"]
    after = ["return inner(value + 2)  ->  return inner(value - 2)"]
    after += ["return inner(value + 2)  ->  return inner(value + 3)"]
    for kernels, expected in ((True, compiled), (False, compiled + after)):
        found = mutants_of(NESTED, kernels)
        assert [mutant.what for mutant in found if "return" in mutant.what] == sorted(
            expected, key=lambda what: (expected.index(what) // 2, what)
        )
    assert mutants_of(NESTED)[0].function.name == "outer"


def test_a_fault_is_known_by_its_function_whatever_else_changes(tmp_path):
    (tmp_path / "one.py").write_text(SOURCE)
    before = mutants.some_of(mutants.faults_of(tmp_path, Path("one.py")), 5, 0)
    rows = [{"digest": fault.digest, "path": "one.py"} for fault in before]
    (tmp_path / "one.py").write_text(SOURCE.replace("LIMIT = 3", "def more(n):\n    return n\n\nLIMIT = 4"))
    after = mutants.some_of(mutants.faults_of(tmp_path, Path("one.py")), 5, 0)
    assert [fault.digest for fault in before] == [fault.digest for fault in after]
    assert mutants.of_these_sources(rows, tmp_path) == rows
    (tmp_path / "one.py").write_text(SOURCE.replace("value != 1", "value != 7"))
    assert mutants.of_these_sources(rows, tmp_path) == []
    assert mutants.of_these_sources([{"digest": "a", "path": "gone.py"}], tmp_path) == []


@pytest.mark.long
def test_faults_without_effect_are_faults_of_the_sources():
    """Whoever changes such a line takes its fault out of the list, or names the new one."""
    assert len(set(EQUIVALENT)) == len(EQUIVALENT)
    for path in {each.path for each in EQUIVALENT}:
        found = mutants_of((ROOT / path).read_text("utf-8"))
        there = {(fault.function.name, fault.what) for fault in found}
        named = {(each.function, each.what) for each in EQUIVALENT if each.path == path}
        assert named <= there, f"{path}: {named - there}"
        assert all(each.reason.endswith(".") for each in EQUIVALENT)


def test_faults_of_a_folder_are_drawn_from_all_its_files(tmp_path):
    (tmp_path / "package" / "inner").mkdir(parents=True)
    for place in ("package/one.py", "package/inner/two.py"):
        (tmp_path / place).write_text(SOURCE)
    every = mutants.faults_of(tmp_path, Path("package"))
    drawn = mutants.some_of(every, 10, 0)
    assert len(every) == 24 and len(drawn) == len({fault.digest for fault in drawn}) == 10
    assert {str(fault.path) for fault in drawn} == {"package/one.py", "package/inner/two.py"}
    assert drawn == mutants.some_of(every[::-1], 10, 0) != mutants.some_of(every, 10, 1)
    assert len(mutants.some_of(mutants.faults_of(tmp_path, Path("package/one.py")), 0, 0)) == 12


def test_the_tests_of_a_line_are_its_own_first_then_the_quickest():
    told = {
        name: Told(name, passed, seconds)
        for name, passed, seconds in (
            ("a/test_own.py::slow", True, 2.0),
            ("a/test_own.py::late", True, 9.0),
            ("a/test_other.py::quick", True, 0.1),
            ("a/test_other.py::quicker", True, 0.05),
            ("a/test_other.py::failed", False, 0.01),
            ("a/test_other.py::elsewhere", True, 0.01),
        )
    }
    lines = {"x/own.py": {3: set(told) - {"a/test_other.py::elsewhere"}, 5: {"a/test_other.py::elsewhere"}}}
    lines["own/part.py"] = lines["x/own.py"]
    reached = Reached(lines, told)
    ordered = ["a/test_own.py::slow", "a/test_other.py::quicker", "a/test_other.py::quick"]
    assert reached.tests_of("x/own.py", range(3, 5), 3.0, 30.0) == ordered
    assert reached.tests_of("own/part.py", range(3, 5), 3.0, 30.0) == ordered
    assert reached.tests_of("x/own.py", range(3, 5), 3.0, 2.07) == ordered[:2]
    assert reached.tests_of("x/own.py", range(3, 5), 3.0, 0.5) == ordered[:1]
    assert reached.tests_of("x/own.py", range(4, 5), 3.0, 30.0) == []
    assert reached.tests_of("x/none.py", range(3, 5), 3.0, 30.0) == []


def test_what_is_taken_while_a_test_is_set_up_counts_for_all_of_its_file(tmp_path):
    (tmp_path / "tests.a.tests").write_text("passed\t0.2\ta.py::one\npassed\t0.1\ta.py::two\n")
    data, source = CoverageData(str(tmp_path / "tests.a.coverage")), "/x/entropy_explore_env/robots/c.py"
    for context, lines in (("", [1]), ("a.py::one is set up", [5]), ("a.py::one", [6]), ("a.py::two", [7])):
        data.set_context(context)
        data.add_lines({source: lines})
    data.write()
    lines = reached_lines(tmp_path).lines["entropy_explore_env/robots/c.py"]
    assert {line: names for line, names in lines.items() if names} == {
        5: {"a.py::one", "a.py::two"},
        6: {"a.py::one"},
        7: {"a.py::two"},
    }


def test_coverage_is_told_which_test_is_set_up_and_which_runs(tmp_path):
    (tmp_path / "made.py").write_text("def made():\n    return 1\n\ndef called(one):\n    return one\n")
    (tmp_path / "test_it.py").write_text(
        "import made, pytest\n@pytest.fixture\ndef one():\n    return made.made()\n"
        "def test_it(one):\n    assert made.called(one) == 1\n"
    )
    words = ["-m", "coverage", "run", "--source=.", "--data-file=took", "-m", "pytest", "-q", "test_it.py"]
    plugins = ["-p", "no:cacheprovider", "-p", "benchmarks.reliability.quick_tests"]
    variables = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, *words, *plugins], cwd=tmp_path, env=variables, check=True)
    data = CoverageData(str(tmp_path / "took"))
    data.read()
    lines = data.contexts_by_lineno(str(tmp_path / "made.py"))
    assert lines[2] == [f"test_it.py::test_it{SET_UP}"] and lines[5] == ["test_it.py::test_it"]


KERNEL = """
def doubled(value):
    return value * 2
"""
TESTS = """
import time

from entropy_explore_env.some import doubled

def test_sound():
    assert True

def test_doubled():
    assert doubled(3) == 6

def test_wrong():
    assert False

def test_waits():
    while doubled(1) != 2:
        time.sleep(0.01)

def test_loops():
    while doubled(1) != 2:
        pass
"""


@pytest.fixture
def host(tmp_path, monkeypatch):
    for package in ("benchmarks", "benchmarks/reliability", "entropy_explore_env", "tests"):
        (tmp_path / package).mkdir(parents=True)
        (tmp_path / package / "__init__.py").touch()
    for name in ("mutant_runs.py", "quick_tests.py"):
        shutil.copy(Path(mutant_runs.__file__).parent / name, tmp_path / "benchmarks" / "reliability")
    (tmp_path / "entropy_explore_env" / "some.py").write_text(KERNEL)
    (tmp_path / "tests" / "test_some.py").write_text(TESTS)
    monkeypatch.setattr(mutant_runs, "_TEST_S", 1.0)
    with Host(tmp_path) as running:
        yield running


def test_faults_are_found_one_after_another_by_the_first_test_that_fails(host):
    path, sound, doubled, wrong, waits, loops = (
        Path("entropy_explore_env/some.py"),
        *(f"tests/test_some.py::test_{name}" for name in ("sound", "doubled", "wrong", "waits", "loops")),
    )
    thrice = KERNEL.replace("2", "3")
    assert host.first_failure(path, KERNEL, [sound, doubled], 60.0) is None
    assert host.first_failure(path, thrice, [sound, doubled], 60.0) == First(doubled)
    assert host.first_failure(path, KERNEL.replace("2", "2.0"), [doubled], 60.0) is None
    assert host.first_failure(path, thrice, [waits], 3.0) == First(LATE, late=True)
    assert host.first_failure(path, "def doubled(", [doubled], 60.0) is not None
    assert (host.folder / path).read_text() == KERNEL
    assert host.passes_soundly(doubled) and not host.passes_soundly(wrong)
    drawn = mutants.drawn(path, mutants_of(KERNEL)[0])
    told = {name: Told(name, True, 0.1 * place) for place, name in enumerate((wrong, sound, doubled))}
    reached = Reached({str(path): {3: set(told)}}, told)
    row = row_of(host, drawn, reached, Args())
    assert (row["found"], row["tests"], row["line"]) == (doubled, 3, 3)
    assert row["what"] == "return value * 2  ->  return value * 3"
    assert row_of(host, drawn, Reached({}, told), Args())["found"] == ""
    told = {name: Told(name, True, 0.1 * place) for place, name in enumerate((loops, sound, doubled))}
    for tests, found, late in (((loops, sound, doubled), doubled, False), ((loops, sound), "", True)):
        row = row_of(host, drawn, Reached({str(path): {3: set(tests)}}, told), Args())
        assert (row["found"], row["late"]) == (found, late)


def test_a_folder_that_is_not_measured_is_refused(tmp_path):
    for path in ("entropy_explore_env/worlds", "benchmarks", "entropy_explore_env/missions/none.py"):
        with pytest.raises(SettingError, match="path"):
            main([path, "--out", str(tmp_path)])


def test_what_is_known_is_not_run_again_unless_no_test_found_it(tmp_path, capsys, monkeypatch):
    path = Path("entropy_explore_env/belief/fields.py")
    drawn = mutants.some_of(mutants.faults_of(ROOT, path), 2, 0)
    rows = [
        {"digest": fault.digest, "path": str(path), "line": 1, "what": "x", "found": found, "tests": 2}
        for fault, found in zip(drawn, ("x", ""), strict=True)
    ]
    kept = tmp_path / "entropy_explore_env.belief.fields.jsonl"
    kept.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert main([str(path), "--sample", "2", "--no-kernels", "--out", str(tmp_path)]) == 1
    assert "1 of 2 faults were found, 2 drawn of" in capsys.readouterr().out
    again = ["--retry", "--stop-s", "0", "--kept", str(tmp_path / "none")]
    monkeypatch.setattr(mutants, "_reached", lambda kept, package: Reached({}, {}))
    assert main([str(path), "--sample", "2", "--no-kernels", "--out", str(tmp_path), *again]) == 0
    assert "1 of 1 faults were found, 2 drawn of" in capsys.readouterr().out
    monkeypatch.setitem(fault_table._REASONS, (str(path), "", "x"), "Both are odd.")
    monkeypatch.delattr(mutants, "_reached")  # nothing is run: the other one is named as without effect
    for words in ([], again):
        assert main([str(path), "--sample", "2", "--no-kernels", "--out", str(tmp_path), *words]) == 0
        assert "1 of 1 faults were found, 2 drawn of" in capsys.readouterr().out
