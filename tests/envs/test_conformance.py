"""The conformance test holds for every scenario, and fails where the contract is broken."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from entropy_explore_env import SCENARIOS, EntropyExploreEnv, EntropyExploreVectorEnv, Missions, SettingError
from entropy_explore_env.command import BAD_INPUT, run_command
from entropy_explore_env.envs import conformance
from entropy_explore_env.envs.checks import ActionChecker
from entropy_explore_env.envs.conformance import (
    ConformanceError,
    Task,
    check_conformance,
    leaves,
    require_same,
)
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from tests.envs.pairwise import pairwise
from tests.reference.scenes import SMALL

BOX = SCENARIOS["box-7x11x5"]
PARTS = {"patch": True, "overview": True, "action_mask": True}
KINDS = ("continuous", "discrete")


def conform(scenario: str, robots: int, kind: str) -> int:
    """Check a team that observes everything; how many checks held."""
    said: list[str] = []
    check_conformance(
        scenario,
        robots=robots,
        steps=25,
        seed=robots,
        action={"kind": kind},
        observation=PARTS,
        report=said.append,
    )
    return len(said)


@pytest.mark.parametrize(("scenario", "robots", "kind"), pairwise(SMALL, (1, 2, 5), KINDS))
def test_scenarios_conform(in_this_process: int, scenario: str, robots: int, kind: str) -> None:
    assert conform(scenario, robots, kind) == in_this_process == 8


@pytest.mark.parametrize("period_s", [None, 1.0])
def test_a_team_with_faults_conforms(in_this_process: int, period_s: float | None) -> None:
    faults = {
        "stop": {"mean_s": 12.0, "lasts_s": 3.0},
        "blind": {"mean_s": 10.0, "lasts_s": 5.0},
        "silent": {"mean_s": 10.0, "lasts_s": 5.0},
        "sensor": {"lost_rays": 0.2, "range_factor": 1.05},
        "radio": {"garbled": 0.2, "repeated": 0.2, "late": 0.2},
    }
    channel = {"reach": "signal", "i_min_bits": 0.0}
    settings = {"faults": faults, "channel": channel, "decision_period_s": period_s}
    said: list[str] = []
    check_conformance(BOX, robots=3, steps=25, report=said.append, **settings)
    assert len(said) == in_this_process


@pytest.mark.parametrize("period_s", [None, 1.0])
def test_a_team_that_drifts_conforms(in_this_process: int, period_s: float | None) -> None:
    drift = {"xy_m_per_sqrt_m": 0.05, "z_m_per_sqrt_m": 0.01, "yaw_rad_per_sqrt_m": 0.02}
    settings = {
        "robot": {"localization": drift, "redecide": "on_scan"},
        "sensor": {"scan_every_m": 0.4},
        "fiducials": {"number": 4},
        "channel": {"i_min_bits": 0.0, "delay_s": 0.3},
        "decision_period_s": period_s,
    }
    said: list[str] = []
    check_conformance(BOX, robots=3, steps=25, report=said.append, **settings)
    assert len(said) == in_this_process


@pytest.mark.parametrize("period_s", [None, 1.0])
def test_a_team_that_sends_summaries_conforms(in_this_process: int, period_s: float | None) -> None:
    settings = {
        "channel": {"content": "summaries", "summary_every_s": 1.0, "delay_s": 0.3, "loss_probability": 0.2},
        "observation": {"overview": True},
        "decision_period_s": period_s,
    }
    said: list[str] = []
    check_conformance(BOX, robots=3, steps=25, report=said.append, **settings)
    assert len(said) == in_this_process


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("robots", range(1, 6))
@pytest.mark.parametrize("scenario", SMALL)
def test_scenarios_conform_in_fresh_processes_too(scenario: str, robots: int, kind: str) -> None:
    assert conform(scenario, robots, kind) == len(conformance.CHECKS) == 9


@pytest.mark.parametrize(
    "settings",
    [
        {"decision_period_s": None, "time_limit_s": 25.0, "observation": {"flat": True}},
        {"decision_period_s": None, "time_limit_s": 25.0, "robot": {"redecide": 0.7}},
        {"ending": {"seen_share": 0.6, "time_limit_s": 60.0}, "time_limit_s": 60.0},
        {"robot": {"redecide": "on_scan", "navigator": "planned"}, "sensor": {"scan_every_m": 0.3}},
        {"robots": 9, "robot": {"body_radius_m": 0.24}, "reward": {"kind": "team", "cost_per_s": 0.001}},
        {"robot": {"motion": "planar", "reach_m": float("inf")}, "channel": {"range_m": 1.5}},
        {
            "grid": Grid((9, 6, 1), 0.5),
            "world": "furnished",
            "ending": {"sigma_end": 3.0, "termination": "all"},
        },
    ],
)
@pytest.mark.usefixtures("in_this_process")
def test_scenarios_of_one_s_own_conform(settings: dict[str, Any]) -> None:
    check_conformance(with_settings(BOX, settings), steps=None if "time_limit_s" in settings else 25, seed=3)


def test_a_scenario_full_of_chance_conforms() -> None:
    channel = {"loss_probability": 0.3, "delay_s": 2.0, "i_min_bits": 0.0}
    check_conformance(BOX, steps=25, robots=3, channel=channel, sensor={"range_noise_m": 0.1})


@pytest.mark.parametrize("redecide", ["at_stop", pytest.param(0.7, marks=pytest.mark.long)])
@pytest.mark.usefixtures("in_this_process")
def test_candidates_as_actions_conform(redecide: str | float) -> None:
    observation = {"action_mask": True, "overlaps": True, "drive": True}
    robot = {"redecide": redecide, "navigator": "planned"}
    action = {"kind": "candidates", "candidates": 10}
    check_conformance(BOX, steps=8, robots=3, action=action, observation=observation, robot=robot)


def test_bad_settings_are_refused() -> None:
    with pytest.raises(SettingError, match=r"Scenario\.speed"):
        check_conformance(BOX, speed=3)
    with pytest.raises(SettingError, match="seed"):
        check_conformance(BOX, seed=-1)
    with pytest.raises(SettingError, match="max_cycles"):
        check_conformance(BOX, steps=0)


def task(kind: str = "continuous", **settings: Any) -> Task:
    observation = {"observation": {"action_mask": True}}
    return Task(
        with_settings(
            BOX, {"robots": 3, "max_cycles": 30, "action": {"kind": kind}, **observation, **settings}
        ),
        0,
    )


@pytest.mark.usefixtures("in_this_process")
def test_every_check_holds_for_the_tasks_below() -> None:
    for check in conformance.CHECKS:
        check(task("discrete"))
        check(task())


# Broken environments, and the check that has to find each of them. What is replaced, by what:
# the first argument of a fault is what was there before.

Fault = Callable[..., Any]


def same_arrays(before: Fault, env: EntropyExploreEnv) -> Any:
    fresh = before(env)
    kept = env.__dict__.setdefault("kept", fresh)
    for agent in fresh:
        for name in fresh[agent]:
            kept[agent][name][...] = fresh[agent][name]
    return {agent: dict(kept[agent]) for agent in fresh}


def same_dicts(before: Fault, env: EntropyExploreEnv) -> Any:
    fresh = before(env)
    kept = env.__dict__.setdefault("kept", fresh)
    kept.update(fresh)
    return kept


def one_info_for_all(before: Fault, env: EntropyExploreEnv) -> Any:
    return dict.fromkeys(env.agents, next(iter(before(env).values())))


def views_of_the_state(before: Fault, env: EntropyExploreEnv) -> Any:
    rows = env.missions.observations[0]
    return {agent: env.missions.layout.split(row) for agent, row in zip(env.agents, rows, strict=True)}


def nan_at_the_end(before: Fault, env: EntropyExploreEnv) -> Any:
    found = before(env)
    if env.missions.state.missions["cycles"][0] == 30:
        found["robot_2"]["self"][4] = np.nan
    return found


def float64(before: Fault, env: EntropyExploreEnv) -> Any:
    return {
        agent: {name: part.astype(np.float64) for name, part in parts.items()}
        for agent, parts in before(env).items()
    }


def no_seed(before: Fault, missions: Missions, mission: int, seed: int | None, *_: Any) -> None:
    before(missions, mission, None)


def one_seed(before: Fault, missions: Missions, mission: int, seed: int | None, *_: Any) -> None:
    before(missions, mission, 0 if seed is not None else None)


def hash_of_text(before: Fault, missions: Missions, mission: int, seed: int | None, *_: Any) -> None:
    before(missions, mission, None if seed is None else seed + hash("a text") % 1000)


def number_of_missions(before: Fault, missions: Missions, mission: int, seed: int | None) -> Any:
    return before(missions, mission, None if seed is None else seed + missions.count)


def same_episode_again(before: Fault, missions: Missions, mission: int, seed: int | None, *_: Any) -> None:
    before(missions, mission, missions.seeds[mission] if seed is None else seed)


def shared_copy(before: Fault, missions: Missions) -> Any:
    kept = before(missions)
    return {**kept, "state": None, "stash": _stash(missions.state)}


_STASHED: list[Any] = []


def _stash(state: Any) -> int:
    _STASHED.append(state)
    return len(_STASHED) - 1


def from_stash(before: Fault, missions: Missions, kept: dict[str, Any]) -> None:
    before(missions, {**kept, "state": _STASHED[kept["stash"]] if "stash" in kept else kept["state"]})


def lost_stream(before: Fault, missions: Missions, kept: dict[str, Any]) -> None:
    before(missions, kept)
    missions.state.robots["sensor_rng"][:] = 1


def busy_robots_listen(before: Fault, missions: Missions, boxes: np.ndarray, numbers: np.ndarray) -> Any:
    found = before(missions, boxes, numbers)
    missions.state.robots["reward"] += 1e-9 * (boxes.sum(axis=(1, 2)) + numbers.sum(axis=1))[:, None]
    return found


def steps_before_reset(before: Fault, env: EntropyExploreEnv, actions: Any) -> Any:
    if env.missions.episodes[0] < 0:
        return {}, {}, {}, {}, {}
    return before(env, actions)


def counts_before_checking(before: Fault, env: EntropyExploreEnv, actions: Any) -> Any:
    env.missions.state.missions["enqueued"] += 1
    try:
        found = before(env, actions)
    finally:
        pass
    env.missions.state.missions["enqueued"] -= 1
    return found


def steps_after_the_end(before: Fault, env: EntropyExploreVectorEnv, actions: Any) -> Any:
    env.missions.state.missions["end"] = 0
    return before(env, actions)


def clips(before: Fault, checker: ActionChecker, actions: Any) -> Any:
    limited = [
        (a, np.clip(x, -1, 1) if isinstance(x, np.ndarray) and x.dtype.kind == "f" else x) for a, x in actions
    ]
    return before(checker, limited)


def clips_table(before: Fault, checker: ActionChecker, table: Any, *sizes: int) -> Any:
    return before(
        checker,
        np.clip(table, -1, 1) if isinstance(table, np.ndarray) and table.dtype.kind == "f" else table,
        *sizes,
    )


def names_nobody(before: Fault, checker: ActionChecker, actions: Any) -> Any:
    return before(checker, [("somebody", action) for _, action in actions])


def new_space(before: Fault, env: EntropyExploreEnv, agent: str) -> Any:
    return env.missions.layout.space()


def rewards_of_strangers(before: Fault, env: EntropyExploreEnv, actions: Any) -> Any:
    found = before(env, actions)
    return found[0], {**found[1], "robot_9": 0.0}, *found[2:]


def infinite_reward(before: Fault, env: EntropyExploreEnv, actions: Any) -> Any:
    found = before(env, actions)
    return found[0], dict.fromkeys(found[1], float("inf")), *found[2:]


def shuffled_missions(before: Fault, env: EntropyExploreVectorEnv) -> Any:
    return {name: part[::-1].copy() for name, part in before(env).items()}


def same_batch(before: Fault, env: EntropyExploreVectorEnv) -> Any:
    fresh = before(env)
    kept = env.__dict__.setdefault("kept", fresh)
    for name, part in fresh.items():
        kept[name][...] = part
    return dict(kept)


def threads_matter(before: Fault, missions: Missions, boxes: np.ndarray, numbers: np.ndarray) -> Any:
    found = before(missions, boxes, numbers)
    found[-1] += 1e-7 * (missions.threads - 1)
    return found


FAULTS: list[tuple[Any, str, Fault, str, str]] = [
    (EntropyExploreEnv, "_observations", same_arrays, "check_fresh", "observations"),
    (EntropyExploreEnv, "_observations", same_dicts, "check_fresh", "observations"),
    (EntropyExploreEnv, "_infos", same_dicts, "check_fresh", "infos"),
    (EntropyExploreEnv, "_infos", one_info_for_all, "check_fresh", "same object"),
    (EntropyExploreEnv, "_observations", views_of_the_state, "check_fresh", "observations"),
    (EntropyExploreEnv, "_observations", nan_at_the_end, "check_spaces", "step 30"),
    (EntropyExploreEnv, "_observations", float64, "check_spaces", "step 0"),
    (EntropyExploreEnv, "observation_space", new_space, "check_spaces", "other objects"),
    (EntropyExploreEnv, "step", rewards_of_strangers, "check_spaces", "step 1"),
    (EntropyExploreEnv, "step", infinite_reward, "check_spaces", "inf"),
    (Missions, "reset", no_seed, "check_repeatable", "step 0"),
    (Missions, "reset", one_seed, "check_repeatable", "begin alike"),
    (Missions, "reset", same_episode_again, "check_repeatable", "begin alike"),
    (Missions, "reset", hash_of_text, "check_processes", "process 1"),
    (Missions, "_episode", number_of_missions, "check_batches", "batch of one"),
    (EntropyExploreVectorEnv, "_observations", shuffled_missions, "check_batches", "observations"),
    (Missions, "step", threads_matter, "check_batches", "two threads"),
    (Missions, "__getstate__", shared_copy, "check_copies", "the original"),
    (Missions, "__setstate__", lost_stream, "check_copies", "pickled copy"),
    (EntropyExploreVectorEnv, "_observations", same_batch, "check_fresh", "vector call"),
    (Missions, "step", busy_robots_listen, "check_busy", "other actions"),
    (EntropyExploreEnv, "step", steps_before_reset, "check_call_order", "step before reset"),
    (EntropyExploreEnv, "step", counts_before_checking, "check_call_order", "enqueued"),
    (EntropyExploreVectorEnv, "step", steps_after_the_end, "check_call_order", "after the end"),
    (EntropyExploreEnv, "step", counts_before_checking, "check_bad_actions", "enqueued"),
    (ActionChecker, "batch", clips, "check_bad_actions", "accepted"),
    (ActionChecker, "table", clips_table, "check_bad_actions", "vector"),
    (ActionChecker, "batch", names_nobody, "check_bad_actions", "not named"),
]


@pytest.mark.parametrize(
    ("place", "name", "fault", "check", "said"), FAULTS, ids=lambda value: getattr(value, "__name__", None)
)
def test_faults_are_found(
    monkeypatch: pytest.MonkeyPatch, place: Any, name: str, fault: Fault, check: str, said: str
) -> None:
    if fault is shared_copy:
        monkeypatch.setattr(Missions, "__setstate__", _wrapped(from_stash, Missions.__setstate__))
    monkeypatch.setattr(place, name, _wrapped(fault, getattr(place, name)))
    noise = {"sensor": {"range_noise_m": 0.05}} if fault is lost_stream else {}
    with pytest.raises(ConformanceError) as caught:
        getattr(conformance, check)(task(**noise))
    assert said in str(caught.value)


def _wrapped(fault: Fault, before: Fault) -> Fault:
    return lambda *given, **named: fault(before, *given, **named)


@pytest.mark.parametrize(
    ("first", "second", "where"),
    [
        ({"a": 1.0}, {"a": np.nextafter(1.0, 2.0)}, "a"),
        ({"a": 1.0}, {"a": 1}, "a"),
        ({"a": 0.0}, {"a": -0.0}, "a"),
        ({"a": True}, {"a": 1}, "a"),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}, "another order"),
        ({"a": 1}, {"a": 1, "b": None}, "b: nothing"),
        ([1, [2, {"c": 3}]], [1, [2, {"c": 4}]], "1 › 1 › c: int 3, then int 4"),
        (np.zeros((2, 3)), np.zeros((3, 2)), "(2, 3)"),
        (np.zeros(3, np.float32), np.zeros(3), "<f4"),
        (np.array([[0, 1], [2, 3]]), np.array([[0, 1], [9, 3]]), "at (1, 0) np.int64(2), then np.int64(9)"),
        (np.array([0.0, 0.0]), np.array([0.0, -0.0]), "at (1,)"),
        (np.array([{"a": 1}, None]), np.array([{"a": 2}, None]), "0 › a"),
        ((1, 2), [1, 2], "tuple, then list"),
    ],
)
def test_differences_are_found_and_named(first: object, second: object, where: str) -> None:
    with pytest.raises(ConformanceError) as caught:
        require_same("what", leaves(first), leaves(second))
    assert where in str(caught.value)


def test_nan_is_the_same_as_nan_and_bytes_between_fields_mean_nothing() -> None:
    kind = np.dtype([("a", "?"), ("b", "f8")], align=True)
    first, second = np.zeros(2, kind), np.full(16 * 2, 255, np.uint8).view(kind)
    second["a"], second["b"] = first["a"], first["b"]
    require_same("padding", leaves(first), leaves(second))
    require_same("NaN", leaves([np.nan, np.array([np.nan])]), leaves([np.nan, np.array([np.nan])]))


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join(part or os.curdir for part in sys.path)
    return subprocess.run(
        [sys.executable, "-m", "entropy_explore_env", "conformance", *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
        check=False,
    )


def test_the_command_says_what_it_checked() -> None:
    done = command("box-7x11x5", "--robots", "2", "--steps", "12", "--seed", "5")
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert [line.split(":")[0] for line in lines] == [check.__name__ for check in conformance.CHECKS]
    assert all(line.startswith("entropy_explore_env: compil") for line in done.stderr.splitlines())


@pytest.mark.parametrize(
    "arguments",
    [
        ("nowhere",),
        ("room", "--robots", "0"),
        ("room", "--robots", "few"),
        ("room", "--steps", "0"),
        ("room", "--seed", "-1"),
        ("room", "--world", "nowhere.bt"),
        ("room", "--frobnicate"),
        (),
    ],
)
def test_the_command_refuses_bad_input_in_words(
    arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(conformance.main, arguments) == BAD_INPUT
    said = capsys.readouterr()
    assert not said.out
    assert len(said.err.splitlines()) == 1 and said.err.startswith("error: ")


def test_the_command_s_results_as_one_object(
    in_this_process: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert conformance.main(["box-7x11x5", "--steps", "3", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["broken"] is None and len(said["held"]) == in_this_process


@pytest.mark.usefixtures("in_this_process")
def test_a_mission_that_reaches_its_threshold_conforms() -> None:
    quick = with_settings(BOX, {"decision_period_s": None, "ending": {"sigma_end": 25.0}})
    env = EntropyExploreEnv(quick)
    env.reset(seed=0)
    steps = 0
    while env.agents:
        infos = env.step({agent: env.action_space(agent).sample() for agent in env.agents})[4]
        steps += 1
    assert infos["robot_0"]["end"] == "MAPPED" and steps < 200
    check_conformance(quick, steps=None)


def test_the_command_fails_where_the_contract_is_broken(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Missions, "reset", _wrapped(no_seed, Missions.reset))
    assert conformance.main(["box-7x11x5", "--steps", "5"]) == 1
    assert "does not hold: check_repeatable" in capsys.readouterr().out
