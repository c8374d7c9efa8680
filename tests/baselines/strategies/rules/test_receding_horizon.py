"""The rule `receding-horizon`, by hand."""

from __future__ import annotations

import numpy as np

from baselines.strategies.rules import receding_horizon
from baselines.strategies.rules.receding_horizon import RecedingHorizon
from tests.planner.scenes import cell, scene_of
from tests.reference import explorers as reference


def test_a_tree_leads_to_where_something_is_unknown_and_else_to_the_nearest_frontier(monkeypatch):
    plan = np.full((40, 5), reference.WALL, np.int8)
    plan[1:30, 1:4] = reference.FREE
    plan[30:38, 1:4] = reference.UNKNOWN
    scene = scene_of(plan, (15, 2))
    monkeypatch.setattr(receding_horizon, "_EDGE", 0.1)
    planner = RecedingHorizon()
    planner.reset(scene.view.scenario, np.random.default_rng(5))
    x, _ = cell(plan, planner.pick(scene))
    assert x != 15 and plan[cell(plan, planner.pick(scene_of(plan, (15, 2))))] == reference.FREE
    monkeypatch.setattr(receding_horizon, "_LEAST_GAIN", 1e9)
    none = RecedingHorizon()
    none.reset(scene.view.scenario, np.random.default_rng(5))
    assert cell(plan, none.pick(scene_of(plan, (15, 2)))) == (29, 2)
