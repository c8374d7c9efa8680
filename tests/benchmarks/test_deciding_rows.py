"""Rows of decisions and missions are measured."""

from __future__ import annotations

from benchmarks.deciding import decision_row, floor_row, scanner_row
from benchmarks.rows import Effort
from entropy_explore_env.settings.scenarios import BOX

TINY = Effort(rounds=2, long_rounds=1, steps=6)


def test_a_decision_is_measured():
    decision = decision_row(BOX, 2, "planned-rate", TINY.steps, 5.0)
    assert decision.job == "a decision of planned-rate, box-7x11x5, 2 robots"
    assert decision.unit == "ms" and decision.goal == "< 5 ms" and decision.ours > 0


def test_a_scanner_and_a_mission_are_measured():
    scanner = scanner_row(TINY)
    assert "720 rays" in scanner.job and scanner.goal == "≥ 5000 steps/s" and scanner.ours > 0.0
    assert floor_row((240, 200, 1)).ours > 0.0
