"""Rows of exploring plans: that they measure what they say."""

from __future__ import annotations

import numpy as np
from PIL import Image

from benchmarks import exploring
from benchmarks.exploring import dense_plan, exploring_rows, rooms_plan
from benchmarks.rows import Effort
from entropy_explore_env.worlds.load import load_world


def test_a_scan_has_720_rays_on_480_by_640():
    scenario = dense_plan()
    assert scenario.sensor.rays == 720 and scenario.grid.shape == (480, 640, 1)


def test_rooms_have_doors():
    scenario, solid = rooms_plan()
    assert solid.shape == scenario.grid.shape == (1000, 1000, 1)
    assert not solid[50, 25:31].any() and solid[50, 1:25].all() and not solid[25:31, 50].any()


def test_rows_are_positive_and_have_goals(monkeypatch):
    small = exploring.floor_row
    monkeypatch.setattr(exploring, "floor_row", lambda effort: small(effort, (90, 70, 1)))
    rows = exploring_rows(Effort(rounds=1, long_rounds=1, steps=3))
    assert len(rows) == 5 and all(row.ours > 0.0 for row in rows)
    step, decision, larger, visibility, floor = rows
    assert all(row.goal for row in (step, decision, visibility, floor))
    assert larger.ratio == larger.ours / larger.theirs  # of the only round
    assert 200 <= int(decision.job.split(" candidates")[0].split()[-1]) <= 400


def test_a_plan_from_a_file_is_explored_at_its_own_resolution(tmp_path):
    plan = np.full((40, 50), 255, np.uint8)
    plan[:2] = plan[-2:] = plan[:, :2] = plan[:, -2:] = plan[:25, 22:26] = 0
    Image.fromarray(plan).save(tmp_path / "hall.png")
    row = exploring.mission_row("hall", load_world(tmp_path / "hall.png"))
    assert "in hall, 50 × 40 cells" in row.job and 0.0 < row.ours < 60.0 and row.holds
