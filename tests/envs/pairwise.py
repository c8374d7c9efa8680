"""Covering arrays: few cases in which any two values of any two settings meet; faults of three are rare."""

import itertools
from collections.abc import Sequence
from typing import Any

import pytest


def pairwise(*axes: Sequence[Any]) -> list[tuple[Any, ...]]:
    """Cases, drawn greedily: each is the one in which most pairs of values meet that have not met before."""
    numbers = [range(len(axis)) for axis in axes]
    cases = [tuple(enumerate(case)) for case in itertools.product(*numbers)]
    missing = {pair for case in cases for pair in itertools.combinations(case, 2)}
    chosen = []
    while missing:
        best = max(cases, key=lambda case: len(missing.intersection(itertools.combinations(case, 2))))
        missing.difference_update(itertools.combinations(best, 2))
        chosen.append(tuple(axes[axis][value] for axis, value in best))
    return chosen


def params(*axes: Sequence[Any]) -> list[Any]:
    """All cases for `pytest.mark.parametrize`; those that pairs do not need are marked long."""
    needed = pairwise(*axes)
    return [
        pytest.param(*case, id="-".join(map(str, case)), marks=() if case in needed else pytest.mark.long)
        for case in itertools.product(*axes)
    ]
