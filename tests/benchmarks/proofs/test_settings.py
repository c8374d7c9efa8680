"""Drawn scenarios: every setting is drawn, from all that is allowed, and none of them hangs or crashes."""

from __future__ import annotations

import math
from functools import reduce
from types import NoneType, UnionType
from typing import Literal, Union, get_args, get_origin

import numpy as np
import pytest

from benchmarks.proofs.cases import BrokenPromiseError, Found, play_cases
from benchmarks.proofs.drawn_scenarios import draw_scenario, leaves
from benchmarks.proofs.settings import WATCHDOG_S, check, play
from entropy_explore_env import EntropyExploreEnv
from entropy_explore_env.errors import RecordError
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.settings.validation import annotations_of


def scenarios(count, few_kernels=False):
    """The first drawn scenarios."""
    return [draw_scenario(np.random.default_rng(number), few_kernels) for number in range(count)]


def test_every_setting_is_drawn_and_takes_values_of_all_its_kinds():
    """Every member of a Literal, None and numbers where both may be, and ends of ranges."""
    seen = {path: set() for path in leaves(Scenario)}
    for drawn in scenarios(250):
        for path, values in seen.items():
            values.add(reduce(getattr, path, drawn.scenario))
    for path, values in seen.items():
        hint = annotations_of(type(reduce(getattr, path[:-1], BOX)))[path[-1]]
        kinds = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
        for kind in kinds:
            if get_origin(kind) is Literal:
                assert set(get_args(kind)) <= values, path
            elif kind is NoneType:
                assert None in values, path
            else:
                numbers = [each for each in values if not isinstance(each, str | None)]
                assert len(numbers) > 1, path
    assert {1e-4, 1e6, math.inf} & seen["robot", "reach_m"] and len(
        {d.scenario.extra_kinds for d in scenarios(9)}
    ) > 1


def test_a_number_gives_the_same_scenario_again():
    first, second = (draw_scenario(np.random.default_rng(9)) for _ in range(2))
    assert settings_of(first.scenario) == settings_of(second.scenario)
    assert len({repr(settings_of(drawn.scenario)) for drawn in scenarios(20)}) == 20
    assert {len(drawn.given) for drawn in scenarios(20)} == {0, 2}


def test_few_kernels_means_few_kinds_of_observation():
    names = ("panorama", "self_state", "team", "patch", "overview", "action_mask")
    kinds = {tuple(getattr(d.scenario.observation, n) for n in names) for d in scenarios(40, True)}
    assert 2 <= len(kinds) <= 4
    assert len({tuple(getattr(d.scenario.observation, n) for n in names) for d in scenarios(40)}) > 8


def test_what_breaks_a_promise_is_found():
    env = EntropyExploreEnv(BOX)
    observations, _ = env.reset(seed=0)
    rewards = dict.fromkeys(env.agents, 0.0)
    assert check(env, observations, rewards, 0.0) == 0.0
    with pytest.raises(BrokenPromiseError, match="time ran from 1"):
        check(env, observations, rewards, 1.0)
    with pytest.raises(BrokenPromiseError, match="a reward is not finite: nan"):
        check(env, observations, {**rewards, "robot_1": math.nan}, 0.0)
    env.missions.state.robots["goal"][0, 1, 2] = math.inf
    with pytest.raises(RecordError, match=r"robots\.goal\[0, 1, 2\] = inf"):
        check(env, observations, rewards, 0.0)
    observations["robot_0"]["self"] = np.full_like(observations["robot_0"]["self"], math.nan)
    with pytest.raises(BrokenPromiseError, match="robot_0 observed is not in its space"):
        check(env, observations, rewards, 0.0)
    env.missions.observations[0, 0, 3] = math.nan
    with pytest.raises(BrokenPromiseError, match=r"nan.* at \[0, 0, 3\] of .* outside its space"):
        check(env, observations, rewards, 0.0)


def test_drawn_scenarios_neither_hang_nor_crash_nor_break_promises(monkeypatch):
    """In a process of its own, with the assertions of kernels compiled in."""
    monkeypatch.setenv("ENTROPY_EXPLORE_ASSERT", "1")
    outcomes = [outcome for _, outcome in play_cases(play, range(1, 61), 180.0)]
    assert [outcome for outcome in outcomes if not isinstance(outcome, Found)] == []
    figures = [outcome.figures for outcome in outcomes if isinstance(outcome, Found)]
    assert max(each["s at most"] for each in figures) < WATCHDOG_S
    assert {each["episodes"] > 1 for each in figures} == {False, True}
