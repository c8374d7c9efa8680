"""Faults put into a file: each is one change, in functions only."""

from __future__ import annotations

import ast

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
