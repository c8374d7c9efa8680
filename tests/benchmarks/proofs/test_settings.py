"""Drawn scenarios: every setting is drawn, from all that is allowed, and none of them hangs or crashes."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from benchmarks.proofs.cases import BrokenPromiseError, Found, play_cases
from benchmarks.proofs.drawn_scenarios import FIELDS, Numbers, draw_scenario
from benchmarks.proofs.settings import WATCHDOG_S, check, play
from entropy_explore_env import EntropyExploreEnv
from entropy_explore_env.errors import EntropyExploreError
from entropy_explore_env.settings.channel import Channel
from entropy_explore_env.settings.faults import Outage, RadioFault, SensorFault
from entropy_explore_env.settings.fiducials import Fiducials
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.settings.sensor import RangeSensor

DRAWN_OTHERWISE = {
    RangeSensor: {"field_of_view_rad", "angular_step_rad"},
    Robot: {"localization", "above_ground_m"},
    Fiducials: {"positions_m"},
    Observation: {"patch_shape", "overview_shape"},
    Scenario: {"name", "grid", "world", "robot", "sensor", "extra_kinds"}
    | {"channel", "faults", "fiducials", "ending", "reward", "action", "observation"},
    Channel: {"signal"},
    Outage: {"robots"},
    SensorFault: {"robots"},
    RadioFault: {"robots"},
}


def scenarios(count, few_kernels=False):
    """The first scenarios that are allowed."""
    found, number = [], 0
    while len(found) < count:
        number += 1
        try:
            found.append(draw_scenario(np.random.default_rng(number), few_kernels))
        except EntropyExploreError:
            continue
    return found


def parts_of(settings):
    """A dataclass of settings, and all those in it."""
    within = [part for part in vars(settings).values() if dataclasses.is_dataclass(part)]
    return [settings, *(each for part in within for each in parts_of(part))]


def test_every_setting_is_drawn_and_takes_values_of_all_its_kinds():
    seen = {}
    for drawn in scenarios(400):
        for kind, fields in FIELDS.items():
            for part in parts_of(drawn.scenario):
                if isinstance(part, kind):
                    for field in fields:
                        seen.setdefault((kind, field), set()).add(getattr(part, field))
    for kind, fields in FIELDS.items():
        assert set(fields) | DRAWN_OTHERWISE.get(kind, set()) == {f.name for f in dataclasses.fields(kind)}
        for field, values in fields.items():
            if isinstance(values, Numbers):
                numbers = {v for v in seen[kind, field] - set(values.also) if math.isfinite(v)}
                least = max(values.least, min(values.usual_least, 1.0))
                assert len(numbers) > 5 and min(numbers) <= least and set(values.also) <= seen[kind, field]
            else:
                assert set(values) == seen[kind, field], field


def test_a_number_gives_the_same_scenario_again():
    first, second = (draw_scenario(np.random.default_rng(9)) for _ in range(2))
    assert settings_of(first.scenario) == settings_of(second.scenario)
    assert len({repr(settings_of(drawn.scenario)) for drawn in scenarios(20)}) == 20
    assert {len(drawn.given) for drawn in scenarios(20)} == {0, 2}


def test_few_kernels_means_few_kinds_of_observation():
    names = ("panorama", "self_state", "team", "patch", "overview", "action_mask")
    kinds = {tuple(getattr(d.scenario.observation, n) for n in names) for d in scenarios(40, True)}
    assert len(kinds) == 2
    assert len({tuple(getattr(d.scenario.observation, n) for n in names) for d in scenarios(40)}) > 8


def test_what_breaks_a_promise_is_found():
    env = EntropyExploreEnv(BOX)
    observations, _ = env.reset(seed=0)
    rewards = dict.fromkeys(env.agents, 0.0)
    assert check(env, observations, rewards, 0.0) == 0.0
    with pytest.raises(BrokenPromiseError, match="time ran from 1"):
        check(env, observations, rewards, 1.0)
    with pytest.raises(BrokenPromiseError, match="reward of robot_1 is nan"):
        check(env, observations, {**rewards, "robot_1": math.nan}, 0.0)
    env.missions.state.robots["goal"][0, 1, 2] = math.inf
    with pytest.raises(BrokenPromiseError, match=r"robots\.goal\[0, 1, 2\] = inf"):
        check(env, observations, rewards, 0.0)
    observations["robot_0"]["self"] = np.full_like(observations["robot_0"]["self"], math.nan)
    env.missions.observations[0, 0, 3] = math.nan
    with pytest.raises(BrokenPromiseError, match=r"nan.* at 3 of .* outside its space"):
        check(env, observations, rewards, 0.0)


@pytest.mark.parametrize(
    "numbers", [range(1, 61), pytest.param(range(2000), marks=pytest.mark.long)], ids=len
)
def test_drawn_scenarios_neither_hang_nor_crash_nor_break_promises(monkeypatch, numbers):
    """In a process of its own, with the assertions of kernels compiled in."""
    monkeypatch.setenv("ENTROPY_EXPLORE_ASSERT", "1")
    outcomes = [outcome for _, outcome in play_cases(play, numbers, 180.0)]
    assert [outcome for outcome in outcomes if not isinstance(outcome, Found)] == []
    figures = [outcome.figures for outcome in outcomes if isinstance(outcome, Found)]
    assert max(each["s at most"] for each in figures) < WATCHDOG_S
    assert {each["episodes"] > 1 for each in figures} == {False, True}
