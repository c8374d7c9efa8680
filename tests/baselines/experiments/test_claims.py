"""Claims as rows of JSON and of tables."""

from __future__ import annotations

import json

from baselines.experiments.claims import Claim, claims_table

CLAIM = Claim("t", "falls", "< 1", 0.51239, 0.4, 12345.6, True)


def test_a_claim_is_a_row_of_json():
    row = CLAIM.row()
    assert list(row) == ["id", "claim", "paper", "ours", "low", "high", "holds"]
    assert json.loads(json.dumps(row)) == row


def test_the_table_of_claims_shows_four_digits_and_what_does_not_hold():
    lines = claims_table([CLAIM, Claim("u", "rises", None, 2.0, None, None, False)]).splitlines()
    assert lines[0] == "| claim | paper | ours | 95 % interval | holds |"
    assert lines[2] == "| falls | < 1 | 0.5124 | 0.4 … 12,346 | yes |"
    assert lines[3] == "| rises | - | 2 |  | **no** |"
    assert "| 0.5124 | 0.4 …" in claims_table([CLAIM], interval_digits=1)
    narrow = claims_table([Claim("v", "is", 1.0, 0.59, 0.5678, 0.6123, True)], interval_digits=2)
    assert "| 0.59 | 0.57 … 0.61 |" in narrow
