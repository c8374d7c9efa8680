"""Conformance: calls out of order and bad actions are refused with a named error, and change nothing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from entropy_explore_env.envs.episodes import (
    ConformanceError,
    Task,
    by_agent,
    play,
    require_same,
    snapshot,
    story,
)
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.errors import ActionError, CallOrderError, EntropyExploreError


def check_call_order(task: Task) -> None:
    """Check that calls before reset and after the end raise a CallOrderError and change nothing."""
    env, batch = task.env(), task.vector_env(2)
    actions, table = by_agent(env, task.actions(0, 0, 1)), task.table(2, 0, 1)
    require_refused("step before reset", env, CallOrderError, lambda: env.step(actions))
    require_refused("view before reset", env, CallOrderError, lambda: env.view("robot_0"))
    require_refused("vector step before reset", batch, CallOrderError, lambda: batch.step(table))
    story(play(env, task))
    require_refused("step after the end", env, CallOrderError, lambda: env.step(actions))
    never = task.vector_env(2, autoreset_mode="Disabled")
    never.reset(seed=task.seed)
    while not any(np.logical_or(*never.step(table)[2:4])):
        pass
    require_refused("vector step after the end", never, CallOrderError, lambda: never.step(table))


def check_bad_actions(task: Task) -> None:
    """Check that a bad action raises an ActionError with field and value, and changes nothing."""
    env = task.env()
    env.reset(task.seed)
    good = by_agent(env, task.actions(0, 0, 1))
    fewer, one = dict(list(good.items())[:-1]), good["robot_0"]
    teams = {"a robot without action": fewer, "no dict": list(good.values()), "None": None}
    teams |= {"a stranger": {**good, "robot_x": one}, "a stranger in place": {**fewer, "robot_x": one}}
    for name, team in teams.items():
        require_refused(name, env, ActionError, lambda team=team: env.step(team))  # type: ignore[arg-type]
    for agent, action in good.items():
        for name, wrong in bad_actions(task, action).items():
            team = {**good, agent: wrong}
            refusal = require_refused(f"{name}, {agent}", env, ActionError, lambda team=team: env.step(team))
            if f"actions[{agent}]" not in refusal:
                raise ConformanceError(f"{name}, {agent}: not named in {refusal!r}")
    batch = task.vector_env(2)
    batch.reset(seed=task.seed)
    for name, wrong in bad_actions(task, task.table(2, 0, 1)).items():
        require_refused(f"vector, {name}", batch, ActionError, lambda wrong=wrong: batch.step(wrong))


def bad_actions(task: Task, good: np.ndarray) -> dict[str, Any]:
    """Return what must be refused in place of a robot's or a VectorEnv's action, by what is wrong with it."""
    wrong: dict[str, Any] = {"None": None, "text": "up", "a dict": {}, "ragged": [[0.0], [0.0, 0.0]]}
    wrong |= {"complex": good * 1j, "too many": np.stack([good, good]), "an object": object()}
    if task.scenario.action.by_number:
        wrong |= {"negative": np.full_like(good, -1), "past": np.full_like(good, task.choices)}
        return {**wrong, "NaN": np.full(good.shape, math.nan), "bool": np.ones(good.shape, bool)}
    entries = {"NaN": math.nan, "inf": math.inf, "-inf": -math.inf, "above": 1.01, "below": -1.01}
    for name, entry in entries.items():
        wrong[name] = good.copy()
        wrong[name].flat[-1] = entry
    return {**wrong, "too short": good[..., :-1], "whole": np.zeros(good.shape, int), "bool": good > 0}


def require_refused(
    what: str,
    env: EntropyExploreEnv | EntropyExploreVectorEnv,
    kind: type[EntropyExploreError],
    call: Callable[[], object],
) -> str:
    """Raise a ConformanceError unless a call raises this kind of error, changing nothing; its message."""
    before = snapshot(env)
    try:
        call()
    except kind as error:
        require_same(f"{what}, state before and after", before, snapshot(env))
        return str(error)
    except Exception as error:
        raise ConformanceError(f"{what}: {type(error).__name__} ({error}), not {kind.__name__}") from error
    raise ConformanceError(f"{what}: accepted")
