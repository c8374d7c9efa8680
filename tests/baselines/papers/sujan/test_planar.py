"""Sujan's planar experiments: cells, what is recorded scan by scan, claims and page."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.experiments.trials import CellTrial
from baselines.papers.sujan import planar
from baselines.papers.sujan.planar import (
    EXPERIMENT,
    METHODS,
    OTHERS,
    all_claims,
    by_scan,
    cell_id,
    mapped,
    mapped_per_metre,
    scenario_of,
)
from tests.baselines.papers.pages import cells_of, run_paper


def test_a_mission_records_what_is_mapped_and_driven_scan_by_scan(monkeypatch):
    monkeypatch.setattr(planar, "SCANS", 12)
    cell = cells_of(EXPERIMENT, 1)[cell_id(2, "iii")]
    record = CellTrial(cell, 0).run()
    shares, ways = record["mapped"], record["driven_m_by_scan"]
    assert len(shares) == len(ways) == record["scans"] + 1 and shares[0] == ways[0] == 0.0
    assert shares == sorted(shares) and ways == sorted(ways)
    assert ways[-1] == pytest.approx(record["distance_m"], abs=0.02) and 0.02 < shares[-1] < 1.0
    assert scenario_of(2).ending.max_cycles == 12


def records_of(curves):
    """Records with these (shares, ways) by cell, the same in three worlds but for a little."""
    return {
        cell: [
            {"mapped": [s * (1 + 0.01 * world) for s in shares], "driven_m_by_scan": list(ways)}
            for world in range(3)
        ]
        for cell, (shares, ways) in curves.items()
    }


def test_claims_by_hand(monkeypatch):
    """(v) maps twice what the others do, on the same way; random poses drive ten times as far."""
    monkeypatch.setattr(planar.by_scan, "__defaults__", (3,))
    curves = {}
    for robots in (1, 2):
        for method in METHODS:
            high = 0.4 if method == "v" else 0.2
            way = 1000.0 if method == "i" else 110.0 if method == "v" else 100.0
            curves[cell_id(robots, method)] = ([0.0, 0.1, high], [0.0, 0.5 * way, way])
    records = records_of(curves)
    np.testing.assert_allclose(by_scan(records, cell_id(1, "v"), "mapped", 3)[0], [0.0, 0.1, 0.4, 0.4])
    assert mapped(records, cell_id(1, "v"))[0] == pytest.approx(0.3)
    assert mapped_per_metre(records, cell_id(1, "i"))[0] == pytest.approx(0.02)
    claims = {claim.id: claim for claim in all_claims(records)}
    assert len(claims) == 2 * (4 + 2 + 4 + 3 + 1)
    assert claims["most-1-iii"].ours == pytest.approx(0.3 / (0.5 / 3.0)) and claims["most-1-iii"].holds
    assert not claims["order-2-iii"].holds  # the same: not more
    assert claims["worst-1-ii"].ours == pytest.approx(0.1) and claims["worst-1-ii"].holds
    assert claims["way-2"].ours == pytest.approx(1.1) and claims["way-2"].holds


def test_the_command_writes_its_page_and_goes_on_where_it_was(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(planar, "SCANS", 10)
    monkeypatch.setattr(planar.by_scan, "__defaults__", (10,))
    ran = run_paper("sujan-planar", tmp_path, capsys, "--quick", "--seeds", "1")
    assert len(ran.claims) == 28 and "(v) next-best-view" in ran.page
    assert len(ran.rows) == 2 * len(METHODS) + len(OTHERS)
