"""Missions that tests of rules play, and their choices."""

from __future__ import annotations

import numpy as np

from baselines.strategies.protocol import Strategy
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import RobotView, view_of
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import find_scenario


def missions_of(**settings: object) -> Missions:
    """A mission among occlusions on a small plan."""
    small: dict[str, object] = {
        "grid": Grid((80, 90, 1), 0.5),
        "decision_period_s": None,
        "track_truth": True,
    }
    missions = Missions(with_settings(find_scenario("occlusions"), {**small, **settings}))
    missions.reset(0, seed=3)
    return missions


def play(missions: Missions, strategy: Strategy, decisions: int) -> list[tuple[RobotView, np.ndarray]]:
    """Chosen viewpoints, decision by decision, of a strategy in the first mission."""
    strategy.reset(missions.scenario, missions.strategy_generator(0))
    chosen = []
    for _ in range(decisions):
        team = missions.scenario.robots
        views = [view_of(missions, 0, robot) for robot in range(team)]
        deciding = [view for view in views if view.deciding]
        actions = np.zeros((1, team, 3))
        for view, viewpoint in zip(deciding, [strategy.choose(view) for view in deciding], strict=True):
            actions[0, view.robot] = view.action_for(viewpoint)
            chosen.append((view, viewpoint))
        missions.step(actions, np.zeros((1, team), np.int64))
    return chosen
