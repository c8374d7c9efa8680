"""Shared maps: what summaries of maps come to, claims, page."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.papers.sujan import sharing
from baselines.papers.sujan.sharing import MAKERS, THRESHOLDS_BITS, all_claims
from entropy_explore_env.errors import RecordError
from entropy_explore_env.robots.map_summary import encode_map, tree_bits
from tests.baselines.papers.pages import run_paper


def test_bits_of_a_tree_are_two_a_node_and_sixteen_a_leaf():
    rng = np.random.default_rng(0)
    mean, precision = rng.random((7, 11, 5), np.float32), np.full((7, 11, 5), 9.0, np.float32)
    data = encode_map(mean, precision, 0.0)
    nodes, rest = divmod(tree_bits(data, mean.shape) - 16 * mean.size, 2)  # all voxels differ: a leaf each
    assert rest == 0 and mean.size < nodes < 2 * mean.size
    assert tree_bits(encode_map(mean, precision, 5.0), mean.shape) == 2 + 16  # one node, one leaf
    for broken in (b"", b"nonsense", data[:-3], 7, b"EEMS\x02" + data[5:]):
        with pytest.raises(RecordError, match="map summary"):
            tree_bits(broken, mean.shape)  # type: ignore[arg-type]
    with pytest.raises(RecordError, match="map summary"):
        tree_bits(data, (11, 7, 5))


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
