"""Rows of decisions and missions are measured, of plans' files, too."""

from __future__ import annotations

import numpy as np
from PIL import Image

from benchmarks.deciding import decision_row, episodes_row, floor, floor_row, plan_rows, room_row, scanner_row
from benchmarks.rows import Effort
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.worlds.load import load_world

TINY = Effort(rounds=2, long_rounds=1, steps=6)


def test_a_decision_is_measured():
    decision = decision_row(BOX, 2, "planned-rate", TINY.steps, 5.0)
    assert decision.job == "a decision of planned-rate, box-7x11x5, 2 robots"
    assert decision.unit == "ms" and decision.goal == "< 5 ms" and decision.ours > 0


def test_a_plan_from_a_file_is_explored_at_its_own_resolution(tmp_path):
    plan, path = np.full((40, 50), 255, np.uint8), tmp_path / "hall.png"
    plan[:2] = plan[-2:] = plan[:, :2] = plan[:, -2:] = plan[:25, 22:26] = 0
    Image.fromarray(plan).save(path)
    *decisions, mission = plan_rows("hall", str(path), load_world(path), TINY)
    for row, name in zip(decisions, ("hall", "hall to be seen whole"), strict=True):
        assert row.job == f"a decision of planned-rate, {name}, 1 robot" and row.goal == "< 50 ms"
        assert row.unit == "ms" and row.ours > 0
    assert "in hall, 50 × 40 cells" in mission.job and 0.0 < mission.ours < 60.0 and mission.holds


def test_missions_a_scanner_and_episodes_are_measured():
    scanner = scanner_row(TINY)
    assert "720 rays" in scanner.job and scanner.goal == "≥ 5000 steps/s" and scanner.ours > 0.0
    assert floor_row("a small floor", floor((90, 70, 1))).ours > 0.0
    assert room_row("random", 1).unit == "s"
    assert 50.0 < episodes_row(1).ours < 2000.0
