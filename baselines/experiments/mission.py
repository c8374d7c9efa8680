"""Run one mission of a strategy through the environment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from baselines.strategies.protocol import Strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.settings import Observation

NOTHING_OBSERVED = Observation(panorama=False, self_state=False, team=False)
"""Strategies read RobotViews: an observation for networks would cost time for nothing."""


def scripted(scenario: Scenario) -> Scenario:
    """The scenario as scripted strategies run it: steps from decision to decision, no observation."""
    return with_settings(scenario, {"decision_period_s": None, "observation": NOTHING_OBSERVED})


def run_mission(
    env: EntropyExploreEnv,
    strategy: Strategy,
    seed: int,
    after_step: Callable[[EntropyExploreEnv], None] | None = None,
    before_step: Callable[[Mapping[str, Any]], None] | None = None,
) -> None:
    """Reset the environment and let a strategy act until the mission is over.

    Args:
        env: With any settings; it is left at the mission's end.
        strategy: Chooses the viewpoints.
        seed: Of the mission.
        after_step: Called after the reset and after every step.
        before_step: Called with the actions before every step.
    """
    env.reset(seed=seed)
    strategy.reset(env.scenario, env.strategy_generator())
    actions = {agent: _idle_action(env, agent) for agent in env.agents}
    if after_step is not None:
        after_step(env)
    while env.agents:
        views = [env.view(agent) for agent in env.deciding_agents()]
        for view, viewpoint in zip(views, strategy.choose(views), strict=True):
            actions[env.agents[view.robot]] = view.action_for(viewpoint)
        if before_step is not None:
            before_step(actions)
        env.step(actions)
        if after_step is not None:
            after_step(env)


def _idle_action(env: EntropyExploreEnv, agent: str) -> np.ndarray | np.int64:
    """An action for a robot that is busy: it is ignored."""
    space = env.action_space(agent)
    return np.zeros(space.shape, np.float32) if space.shape else np.int64(0)
