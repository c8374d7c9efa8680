"""Errors of localization over the way: cells, claims, page."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.papers.sujan import localization
from baselines.papers.sujan.localization import (
    EXPERIMENT,
    all_claims,
    drifting,
    errors_by_way,
    in_world,
    rms_error_m,
    time_to_map,
)
from tests.baselines.papers.pages import cells_of, run_paper


def record_of(error_m, wrong=0.02):
    """A mission of three scans, the second after 100 m, the last after 400 m."""
    return {
        "error_m": [0.0, error_m, error_m],
        "driven_m_by_scan": [0.0, 100.0, 400.0],
        "time_s": [1.0, 110.0, 420.0],
        "mapped": [0.1, 0.2, 0.5],
        "wrong": [0.0, 0.5, wrong],
    }


def test_errors_over_the_way_by_hand():
    records = {"a": [record_of(2.0), record_of(0.4)]}
    errors = errors_by_way(records, "a")
    assert errors.shape == (2, 31)
    assert errors[0, [0, 5, 10, 30]].tolist() == [0.0, 1.0, 2.0, 2.0]
    squares = sum((0.2 * step) ** 2 for step in range(10)) + 21 * 4.0
    assert rms_error_m(records, "a")[0] == pytest.approx(math.sqrt(squares / 31))
    assert time_to_map(records, "a", 0.2).tolist() == [110.0, 110.0]
    assert time_to_map(records, "a", 0.9).tolist() == [420.0, 420.0]


def test_as_many_fiducials_are_drawn_as_are_to_be_within_reach():
    assert (
        in_world(1, "near") == 57 and in_world(10, "far") == 141
    )  # 10⁴ m² over π 7.5², ten times over π 15²
    task = drifting(3, "near", 20)
    assert task.fiducials.number == 170 and task.fiducials.range_m == 7.5 and task.ending.max_cycles == 20
    own = cells_of(EXPERIMENT, 2)["own-landmarks"].scenario
    assert (own.fiducials.own_number, own.fiducials.number) == (16, 0) and own.drifts
    assert task.drifts and drifting(0, "far", 20).fiducials.number == 0


def test_claims_by_hand():
    cells = cells_of(EXPERIMENT, 2)
    assert len(cells) == 12
    records = {name: [record_of(1.0), record_of(1.1)] for name in cells}
    records["fiducials-10-near"] = [record_of(0.5), record_of(0.5)]
    records["own-landmarks"] = [record_of(0.9), record_of(0.9)]
    records["fiducials-3-far-weight-0.3"] = [record_of(1.0, 0.01), record_of(1.0, 0.01)]
    claims = {claim.id: claim for claim in all_claims(records)}
    assert len(claims) == 14
    assert {name for name, claim in claims.items() if claim.holds} == {
        "number-near-10",
        "near-10",
        "own",
        "weight-3-0.3",
    }
    assert claims["near-10"].ours == pytest.approx(1.0 / 2.1)
    assert claims["weight-3-0.3"].ours == pytest.approx(0.5)


def test_the_command_writes_its_page(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(localization, "SCANS", 3)
    ran = run_paper("sujan-localization", tmp_path, capsys, "--seeds", "1")
    assert len(ran.claims) == 14
    assert "| own |" in ran.page and "rms over 300 m, mean of worlds (m)" in ran.page
    record = next(row.record for row in ran.rows if row.cell == "fiducials-10-near")
    assert len(record["error_m"]) == record["scans"] == 3
    assert np.all(np.diff(record["driven_m_by_scan"]) >= 0.0) and np.all(np.diff(record["mapped"]) >= 0.0)
