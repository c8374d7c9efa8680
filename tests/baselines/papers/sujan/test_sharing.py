"""Shared maps: claims, page."""

from __future__ import annotations

import pytest

from baselines.papers.sujan import sharing
from baselines.papers.sujan.sharing import MAKERS, THRESHOLDS_BITS, all_claims
from tests.baselines.papers.pages import run_paper


def test_claims_by_hand():
    tree, packed = [640.0] * len(THRESHOLDS_BITS), [64.0] * len(THRESHOLDS_BITS)
    record = {"full_bits": 6400, "full_packed_bits": 100, "tree_bits": tree, "packed_bits": packed}
    records = {name: [dict(record) for _ in range(3)] for name in MAKERS}
    claims = {claim.id: claim for claim in all_claims(records)}
    assert len(claims) == 9 and all(claim.holds for claim in claims.values())
    assert claims["tree-office"].ours == pytest.approx(0.1)
    assert claims["lossless-terrain"].ours == pytest.approx(0.64)
    for other in records["office"]:
        other["full_packed_bits"] = 60
    assert not {claim.id: claim for claim in all_claims(records)}["lossless-office"].holds


def test_the_command_writes_its_page(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sharing, "SCANS", 4)
    ran = run_paper("sujan-sharing", tmp_path, capsys, "--seeds", "1")
    assert len(ran.claims) == 9 and len(ran.rows) == len(MAKERS)
    record = next(row.record for row in ran.rows if row.cell == "office")
    assert record["full_bits"] == 64 * 240 * 180 and 0 < record["measured"] < 240 * 180
    assert record["tree_bits"] == sorted(record["tree_bits"], reverse=True)
    assert record["rms_error"] == sorted(record["rms_error"]) and record["rms_error"][0] < 0.01
    assert all(p < t for p, t in zip(record["packed_bits"], record["tree_bits"], strict=True))
