"""Faults put into a file: each is one change, in functions only."""

from __future__ import annotations

import ast
import shutil
from pathlib import Path

from benchmarks.reliability import mutants
from benchmarks.reliability.mutants import mutants_of

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


TESTS = """
import time

def test_quick():
    assert True

def test_wrong():
    assert False

def test_slow():
    begun_s = time.process_time()
    while time.process_time() - begun_s < 60.0:
        try:
            time.process_time()
        except Exception:
            pass
"""


def test_quick_tests_are_those_that_pass_in_time(tmp_path):
    (tmp_path / "test_some.py").write_text(TESTS)
    shutil.copytree(Path(mutants.__file__).parent, tmp_path / "benchmarks" / "reliability")
    (tmp_path / "benchmarks" / "__init__.py").touch()  # or another checkout's would be taken
    quick = mutants._quick_tests(tmp_path, ["test_some.py"], 0.3)
    assert quick == ["test_some.py::test_quick"]
    assert mutants._found(tmp_path, quick, 60.0) == ""
    assert (
        mutants._found(tmp_path, [*quick, "test_some.py::test_wrong"], 60.0)
        == "FAILED test_some.py::test_wrong"
    )


def test_faults_of_a_folder_are_drawn_from_all_its_files(tmp_path):
    (tmp_path / "package" / "inner").mkdir(parents=True)
    for place in ("package/one.py", "package/inner/two.py"):
        (tmp_path / place).write_text(SOURCE)
    drawn, every = mutants.drawn_faults(tmp_path, Path("package"), 10, 0)
    assert every == 24 and len(drawn) == len({fault.digest for fault in drawn}) == 10
    assert {str(fault.path) for fault in drawn} == {"package/one.py", "package/inner/two.py"}
    assert drawn == mutants.drawn_faults(tmp_path, Path("package"), 10, 0)[0]
    assert len(mutants.drawn_faults(tmp_path, Path("package/one.py"), 0, 0)[0]) == 12
