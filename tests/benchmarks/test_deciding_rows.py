"""The rows of decisions are measured, and what is measured is what strategies use."""

from __future__ import annotations

import math

import numpy as np

from baselines.suites.bundled_worlds import WORLDS
from benchmarks.deciding import candidates_row, decision_row, mutual_information_row, overlap_bits, plan_rows
from benchmarks.rows import Effort
from entropy_explore_env.belief.visibility import CONE, cone_of
from entropy_explore_env.scenarios import BOX
from entropy_explore_env.worlds.load import load_world

TINY = Effort(rounds=2, steps=6)


def test_rows_are_measured():
    overlap = mutual_information_row(TINY)
    assert overlap.unit == "ms" and overlap.goal == "< 0.2 ms" and overlap.ours > 0
    decision = decision_row(BOX, 2, "planned-rate", TINY.steps, 5.0)
    assert decision.unit == "ms" and decision.goal == "< 5 ms" and decision.ours > 0


def test_decisions_are_measured_in_a_plans_file():
    world = WORLDS / "depot.npz"
    rows = plan_rows("depot", str(world), load_world(world).grid, TINY.steps)
    for row, name in zip(rows, ("depot", "depot to be seen whole"), strict=True):
        assert row.job == f"a decision of planned-rate, {name}, 1 robot" and row.goal == "< 50 ms"
        assert row.unit == "ms" and row.ours > 0


def test_candidates_are_proposed_beside_the_recommended_strategy():
    row = candidates_row(BOX, 1, TINY)
    assert row.peer == "planned-rate" and row.goal == "≥ 0.7 ×" and row.ratio is not None
    assert row.theirs is not None and 0.0 < row.ours < 1e6 and row.theirs > 0.0


def test_overlap_by_hand():
    """The same cone twice shares all that it covers; cones that look away from each other nothing."""
    size, precision, marks = (7, 11, 5), np.full(7 * 11 * 5, 0.25, np.float32), np.ones(7 * 11 * 5, np.uint8)
    ahead, back = (cone_of(np.array([3.5, 5.5, 2.5, yaw, 0.0]), 3.0, 0.4) for yaw in (0.0, math.pi))
    cones = np.zeros(2, CONE)
    cones[0] = cones[1] = ahead
    shared = overlap_bits(cones, size, precision, 1.0, marks)
    assert shared == marks.sum() * 0.5 * math.log2(4.0) > 0
    cones[1] = back
    assert overlap_bits(cones, size, precision, 1.0, marks) in (0.0, math.log2(2.0))  # at most its apex
