"""Covering arrays cover: every pair of values is in a case, and there are few cases."""

from __future__ import annotations

import itertools

import pytest

from tests.envs.pairwise import pairwise, params


@pytest.mark.parametrize(
    ("axes", "most"),
    [
        (("ab", "cd"), 4),
        (("abc", (1, 2, 3, 4, 5), "xy"), 15),
        (("abc", (1, 2, 3, 4, 5), "xy", "klmn"), 20),
        (("ab", "ab", "ab", "ab", "ab"), 6),
    ],
)
def test_every_pair_meets_in_few_cases(axes, most):
    cases = pairwise(*axes)
    for first, second in itertools.combinations(range(len(axes)), 2):
        met = {(case[first], case[second]) for case in cases}
        assert met == set(itertools.product(axes[first], axes[second]))
    assert len(cases) == len(set(cases)) <= most


def test_what_pairs_do_not_need_is_long():
    given = params("abc", (1, 2), "xy")
    assert [case.values for case in given] == list(itertools.product("abc", (1, 2), "xy"))
    assert [case.values for case in given if not case.marks] == sorted(pairwise("abc", (1, 2), "xy"))
    assert {mark.name for case in given for mark in case.marks} == {"long"}
    assert given[0].id == "a-1-x"
