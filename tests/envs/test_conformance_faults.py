"""Each check of conformance finds the broken environments that it is there for."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from entropy_explore_env import SCENARIOS, EntropyExploreEnv, EntropyExploreVectorEnv, Missions
from entropy_explore_env.envs import conformance
from entropy_explore_env.envs.checks import ActionChecker
from entropy_explore_env.envs.conformance import ConformanceError, Task
from entropy_explore_env.settings.changes import with_settings

BOX = SCENARIOS["box-7x11x5"]


def task(kind: str = "continuous", **settings: Any) -> Task:
    observation = {"observation": {"action_mask": True}}
    return Task(
        with_settings(
            BOX, {"robots": 3, "max_cycles": 15, "action": {"kind": kind}, **observation, **settings}
        ),
        0,
    )


@pytest.mark.usefixtures("in_this_process")
def test_every_check_holds_for_sound_environments() -> None:
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
    if env.missions.state.missions["cycles"][0] == 15:
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
    found = before(env, actions)
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
    (EntropyExploreEnv, "_observations", nan_at_the_end, "check_spaces", "step 15"),
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


def test_the_command_fails_where_the_contract_is_broken(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Missions, "reset", _wrapped(no_seed, Missions.reset))
    assert conformance.main(["box-7x11x5", "--steps", "5"]) == 1
    assert "does not hold: check_repeatable" in capsys.readouterr().out
