"""Robots that act in turn, as PettingZoo's AECEnv, play the mission of those that act together."""

import numpy as np
import pytest

from entropy_explore_env import ActionError, CallOrderError, env, parallel_env
from entropy_explore_env.envs.conformance import leaves, require_same
from tests.envs.test_parallel_env import BOX, QUICK, team_actions


def test_taking_turns_plays_the_same_as_acting_together() -> None:
    turns, together = env(BOX, robots=3, **QUICK), parallel_env(BOX, robots=3, **QUICK)
    turns.reset(seed=7)
    first = together.reset(seed=7)
    rng = np.random.default_rng(1)
    for agent in together.agents:
        require_same("reset", leaves(first[0][agent]), leaves(turns.observe(agent)))
    while together.agents:
        actions = team_actions(together, rng)
        rewards = together.step(actions)[1]
        for agent in actions:
            assert turns.agent_selection == agent
            turns.step(actions[agent])
        assert turns.rewards == rewards
    assert all(turns.truncations.values())


def test_bad_actions_of_robots_that_take_turns_are_refused_at_once() -> None:
    turns = env(BOX, robots=2)
    turns.reset(seed=0)
    for bad in (np.full(5, np.nan, np.float32), None, np.zeros(4, np.float32)):
        with pytest.raises(ActionError, match="robot_0"):
            turns.step(bad)
        assert turns.agent_selection == "robot_0"
    assert turns.view("robot_1").robot == 1


def test_turns_out_of_order_are_refused() -> None:
    turns = env(BOX, robots=2, max_cycles=1)
    action = np.zeros(5, np.float32)
    turns.reset(seed=0)
    turns.step(action)
    turns.step(action)
    assert turns.truncations == {"robot_0": True, "robot_1": True}
    with pytest.raises(ActionError, match="None after the mission's end"):
        turns.step(action)
    turns.step(None)
    turns.step(None)
    with pytest.raises(CallOrderError, match="after the mission's end"):
        turns.step(None)
