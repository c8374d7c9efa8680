"""Strategies over drift: cells, claims, page."""

from __future__ import annotations

import pytest

from baselines.papers.sujan import drift
from baselines.papers.sujan.drift import EXPERIMENT, STRATEGIES, all_claims, task
from tests.baselines.papers.pages import cells_of, run_paper


def record_of(half_s, blocked, seen=0.8):
    """Of a mission of 250 s; half_s None = it did not see half."""
    joint = {"t50_seen_s": half_s, "explored": seen}
    return {"t_mission_s": 250.0, "blocked_moves": blocked, "joint": joint}


def test_levels_are_factors_of_the_same_drift():
    low, high = (task(level, 0.1, 50.0).robot.localization for level in ("low", "high"))
    assert low.xy_m_per_sqrt_m == pytest.approx(0.006) and low.yaw_rad_per_sqrt_rad == pytest.approx(0.003)
    assert high.yaw_rad_per_sqrt_m == 0.01 and high.margin_m == low.margin_m == 0.1
    exact = task("none", 0.1, 50.0)
    assert not exact.drifts and exact.robot.localization.margin_m == 0.0
    assert exact.ending.seen_share == 0.8 and exact.ending.time_limit_s == 50.0


def test_claims_by_hand():
    cells = cells_of(EXPERIMENT, 3)
    assert len(cells) == 3 * len(STRATEGIES) + 4
    assert not cells["nearest-frontier-low-plain"].record.guarded
    records = {name: [record_of(100.0, 2), record_of(120.0, 2)] for name in cells}
    records["voronoi-high"] = [record_of(130.0, 2), record_of(156.0, 2)]
    records["nearest-frontier-low-plain"] = [record_of(200.0, 90), record_of(240.0, 70)]
    records["gradient-low"] = [record_of(100.0, 2), record_of(None, 2, 0.4)]
    records["gradient-none"] = [record_of(240.0, 2), record_of(240.0, 2)]
    claims = {claim.id: claim for claim in all_claims(records)}
    assert len(claims) == 4 * len(STRATEGIES) + 8
    assert claims["half-voronoi-high"].ours == pytest.approx(1.3)
    assert claims["half-gradient-low"].ours == pytest.approx(350.0 / 480.0)
    assert claims["half-gradient-low"].claim == "only 50% of the missions did"
    assert claims["seen-gradient-low"].ours == pytest.approx(0.75)
    assert claims["seen-gradient-high"].ours == 1.0
    failed = {name for name, claim in claims.items() if not claim.holds}
    unchanged = {"nearest-frontier-high", "planned-rate-low", "planned-rate-high"}
    assert failed == {"half-voronoi-high", "half-gradient-low", "seen-gradient-low"} | {
        f"{what}-{n}" for what in ("blocked", "guard") for n in unchanged
    }
    assert claims["blocked-nearest-frontier-low"].ours == -78.0
    assert claims["guard-nearest-frontier-low"].ours == pytest.approx(0.5)


def test_the_command_writes_its_page(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(drift, "STRATEGIES", {"random": ""})
    monkeypatch.setattr(drift, "PLAIN", ("random",))
    monkeypatch.setattr(drift, "_QUICK_LIMIT_S", 8.0)
    ran = run_paper("sujan-drift", tmp_path, capsys, "--quick", "--seeds", "1")
    assert len(ran.claims) == 8 and "random, plain" in ran.page
    record = next(row.record for row in ran.rows if row.cell == "random-high-plain")
    assert record["localization"]["rms_error_m"] > 0.0
