"""Covering arrays cover: every pair of values is in a case, and there are few cases."""

import itertools

import pytest

from tests.envs.pairwise import pairwise


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
