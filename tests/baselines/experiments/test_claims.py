"""Claims as rows of JSON, and of the tables of pages."""

from __future__ import annotations

import csv
import io
import json

import pytest

from baselines.experiments.claims import Claim, above, below, claims_csv, groups_table, told
from baselines.experiments.statistics import Interval
from entropy_explore_env.errors import SettingError

CLAIM = Claim("t-1", "< 1", 0.51239, 0.4, 12345.6, True, "from 2")
OTHERS = [
    Claim("t-2", "< 1", 2.0, None, None, False),
    Claim("u", None, "3 of 5", None, None, True),
]


def test_a_claim_is_a_row_of_json_and_of_csv():
    row = CLAIM.row()
    assert list(row) == ["id", "claim", "paper", "ours", "low", "high", "holds"]
    assert json.loads(json.dumps(row)) == row
    (found,) = csv.DictReader(io.StringIO(claims_csv([CLAIM])))
    assert found["ours"] == "0.51239" and found["holds"] == "True"


def test_claims_stand_in_groups_with_what_ours_span_and_how_many_hold():
    lines = groups_table([CLAIM, *OTHERS], {"t-": "it falls", "u": "places", "v": "no claim"}).splitlines()
    assert lines[0] == "| claim | paper | ours (95 % interval, or span) | hold |"
    assert lines[2:] == ["| it falls | < 1 | 0.512 … 2 | 1 of 2 |", "| places | - | 3 of 5 | 1 of 1 |"]
    (line,) = groups_table([CLAIM], {"": "all", "t-": "it falls"}).splitlines()[2:]  # the longest beginning
    assert line == "| it falls | < 1 | 0.5124 (0.4 … 12,346) | 1 of 1 |"
    with pytest.raises(SettingError, match="claim = 'u': expected one in a group: t-"):
        groups_table(OTHERS, {"t-": "it falls"})
    texts = [claim.claim for claim in told([CLAIM, OTHERS[0]], {"t-": "it falls"})]
    assert texts == ["it falls (from 2)", "it falls"]


def test_above_and_below_ask_for_the_whole_interval():
    interval = Interval(1.2, 1.1, 1.3)
    assert above("a", interval).holds and not above("a", interval, 1.15).holds
    assert below("a", interval, 1.5).paper == "< 1.5" and not below("a", interval).holds
    assert above("a", interval, paper=None).paper is None and below("a", interval, paper=0.9).paper == 0.9
    assert f"{interval}" == "1.2 (1.1 … 1.3)" and f"{interval:.2f}" == "1.20 (1.10 … 1.30)"
