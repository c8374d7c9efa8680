"""Missions of a strategy, step by step, as rows of the table of episodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from baselines.experiments.mission import Surroundings, run_mission, scripted
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.scenario import Scenario

Row = dict[str, Any]


class RecordedEnv(EntropyExploreEnv):
    """An environment that keeps what its latest reset or step returned.

    Attributes:
        observed: Agent → its latest observation.
        returned: What the latest step returned beside the observations: rewards, terminations, truncations.
    """

    observed: dict[str, Any]
    returned: tuple[dict[str, float], dict[str, bool], dict[str, bool]]

    def reset(self, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - as the environment has it
        """Reset the environment, and keep what it returned."""
        result = super().reset(*args, **kwargs)
        self.observed = result[0]
        return result

    def step(self, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - as the environment has it
        """Take a step, and keep what it returned."""
        result = super().step(*args, **kwargs)
        self.observed, rewards, terminations, truncations, _ = result
        self.returned = (rewards, terminations, truncations)
        return result


def observed_scenario(scenario: Scenario, observation: Observation) -> Scenario:
    """Return the scenario of scripted strategies with these observations, flat, of robots that decide."""
    seen = with_settings(scripted(scenario), {"observation": observation})
    return with_settings(seen, {"observation": {"flat": True, "while_busy": False}})


def recorded_env(scenario: Scenario, surroundings: Surroundings) -> RecordedEnv:
    """Return an environment for recording missions in a scenario of `observed_scenario`."""
    changed = with_settings(scenario, {"decision_period_s": surroundings.decision_period_s})
    return RecordedEnv(changed, **surroundings.settings())


def record_mission(env: RecordedEnv, strategy: str, seed: int, keep: Callable[[Row], None]) -> int:
    """Run a mission, and hand over its rows in order: step by step, in each the robots.

    Returns:
        How many decisions there were.
    """
    agents, decisions, step = list(env.possible_agents), 0, -1
    before: list[Row] = []

    def begin(actions: Mapping[str, Any]) -> None:
        nonlocal decisions, step
        step += 1
        deciding, time_s = set(env.deciding_agents()), _time_s(env)
        decisions += len(deciding)
        before.clear()
        for robot, agent in enumerate(agents):
            row: Row = {"mission": seed, "step": step, "robot": robot, "time_s": time_s}
            row["decided"] = agent in deciding
            row["observation"] = env.observed[agent].copy() if row["decided"] else None
            row["action"] = _plain(actions[agent]) if row["decided"] else None
            before.append(row)

    def end(env: EntropyExploreEnv) -> None:
        assert isinstance(env, RecordedEnv)
        if not before:
            return  # after the reset
        rewards, terminations, truncations = env.returned
        for agent, row in zip(agents, before, strict=True):
            row["reward"], row["seconds"] = float(rewards[agent]), _time_s(env) - row["time_s"]
            row["terminated"], row["truncated"] = bool(terminations[agent]), bool(truncations[agent])
            keep(row)

    run_mission(env, make_strategy(strategy), seed, end, begin)
    for robot, agent in enumerate(agents):
        keep(_last_row(env, seed, step + 1, robot, agent))
    return decisions


def _last_row(env: RecordedEnv, seed: int, step: int, robot: int, agent: str) -> Row:
    """Return what a robot observes at the mission's end, from which it decides nothing."""
    row: Row = {"mission": seed, "step": step, "robot": robot, "time_s": _time_s(env)}
    row |= {"decided": False, "observation": env.observed[agent].copy(), "action": None}
    _, terminations, truncations = env.returned
    ended = {"terminated": bool(terminations[agent]), "truncated": bool(truncations[agent])}
    return {**row, "reward": 0.0, "seconds": 0.0, **ended}


def _time_s(env: EntropyExploreEnv) -> float:
    return float(env.missions.state.missions[0]["time_s"])


def _plain(action: Any) -> Any:  # noqa: ANN401 - a number or an array
    return np.array(action, np.float32) if np.ndim(action) else int(action)
