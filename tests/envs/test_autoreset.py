"""Missions of a vector environment start anew by themselves, or by a mask, as Gymnasium says."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from entropy_explore_env import (
    CallOrderError,
    EntropyExploreVectorEnv,
    WorldError,
    environment_id,
    parallel_env,
)
from entropy_explore_env.envs.conformance import leaves, require_apart, require_same, snapshot
from entropy_explore_env.missions import episode as missions
from tests.envs.test_vector_env import BOX, ROBOT_INFOS, UNEVEN, some_actions


@pytest.mark.parametrize("mode", [*AutoresetMode, *(mode.value for mode in AutoresetMode)])
def test_metadata_name_the_autoreset_mode(mode: AutoresetMode | str) -> None:
    env = gymnasium.make_vec(environment_id(BOX), num_envs=2, autoreset_mode=mode)
    assert env.metadata["autoreset_mode"] is AutoresetMode(mode)
    default = EntropyExploreVectorEnv(BOX, 2)
    assert default.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


@pytest.mark.parametrize("robots", [1, 3])
def test_the_step_after_the_end_starts_a_mission_and_ignores_its_actions(robots: int) -> None:
    envs = [EntropyExploreVectorEnv(BOX, 4, robots=robots, **UNEVEN) for _ in range(2)]
    begun = [env.reset(seed=2) for env in envs]
    over = np.zeros(4, bool)
    restarts, gained = 0, np.zeros(4)
    for actions in some_actions(envs[0], 40):
        other = actions.copy()
        other[over] *= -0.5
        results = [env.step(given) for env, given in zip(envs, (actions, other), strict=True)]
        require_same("other actions", leaves(results[0]), leaves(results[1]))
        _, rewards, terminations, truncations, infos = results[0]
        if over.any():
            restarts += 1
            assert not rewards[over].any() and not infos["reward_robots"][over].any()
            assert not (terminations | truncations)[over].any()
            assert not infos["time_s"][over].any() and infos["deciding"][over].all()
            np.testing.assert_array_equal(infos["entropy_bits"][over], begun[0][1]["entropy_bits"][over])
        gained += rewards
        over = terminations | truncations
    assert restarts >= 3 and gained.all()


def test_the_same_step_starts_the_next_mission_and_keeps_what_came_last() -> None:
    same = EntropyExploreVectorEnv(BOX, 4, robots=2, autoreset_mode="SameStep", **UNEVEN)
    later = EntropyExploreVectorEnv(BOX, 4, robots=2, **UNEVEN)
    same.reset(seed=0)
    later.reset(seed=0)
    ended = 0
    returned: dict[str, Any] = {}
    for step, actions in enumerate(some_actions(same, 80)):
        found = returned[f"step {step}"] = same.step(actions)
        if not ended:
            expected = later.step(actions)
        over = found[2] | found[3]
        if not over.any():
            assert "final_obs" not in found[4] and "final_info" not in found[4]
            continue
        if not ended:  # from here on the two modes drift apart
            require_same("rewards and ends", leaves(expected[1:4]), leaves(found[1:4]))
            for e in np.flatnonzero(over):
                last = {name: part[e] for name, part in expected[0].items()}
                require_same("final_obs", leaves(last), leaves(found[4]["final_obs"][e]))
                for name in ("time_s", "end", *ROBOT_INFOS):
                    np.testing.assert_array_equal(expected[4][name][e], found[4]["final_info"][name][e])
            following = later.step(actions)
            for name, part in following[0].items():
                np.testing.assert_array_equal(part[over], found[0][name][over])
        ended += int(over.sum())
        assert [observation is not None for observation in found[4]["final_obs"]] == over.tolist()
        assert not found[4]["time_s"][over].any() and (found[4]["final_info"]["time_s"][over] == 20.0).all()
        np.testing.assert_array_equal(found[1], found[4]["reward_robots"].mean(axis=1))
        for observation in found[4]["final_obs"][over]:
            assert same.single_observation_space.contains(observation)
    assert ended > 8
    require_apart(returned)


def test_without_autoreset_missions_wait_for_a_reset_mask() -> None:
    env = EntropyExploreVectorEnv(BOX, 4, robots=2, autoreset_mode=AutoresetMode.DISABLED, **UNEVEN)
    env.reset(seed=0)
    alone = [parallel_env(BOX, robots=2, **UNEVEN) for _ in range(4)]
    for mission, team in enumerate(alone):
        team.reset(seed=mission)
    resets = 0
    for actions in some_actions(env, 40):
        _, rewards, terminations, truncations, _ = env.step(actions)
        for mission, team in enumerate(alone):
            expected = team.step(dict(zip(team.agents, actions[mission], strict=True)))
            assert rewards[mission] == pytest.approx(np.mean(list(expected[1].values())), rel=1e-12)
            assert terminations[mission] == all(expected[2].values())
            assert truncations[mission] == all(expected[3].values())
        over = terminations | truncations
        if over.any():
            before = snapshot(env)
            with pytest.raises(CallOrderError, match=str(int(np.flatnonzero(over)[0]))):
                env.step(actions)
            require_same("refused", before, snapshot(env))
            was = {name: part.copy() for name, part in env.missions.state._asdict().items()}
            observations, _ = env.reset(options={"reset_mask": over})
            resets += 1
            for name, part in env.missions.state._asdict().items():
                require_same(f"not reset › {name}", leaves(was[name][~over]), leaves(part[~over]))
            for mission in np.flatnonzero(over):
                expected, _ = alone[mission].reset()
                for name, part in observations.items():
                    row = np.stack([observation[name] for observation in expected.values()])
                    np.testing.assert_array_equal(part[mission], row)
    assert resets >= 4


def test_a_reset_mask_takes_seeds_for_its_missions_alone() -> None:
    env = EntropyExploreVectorEnv(BOX, 3)
    first = env.reset(seed=[5, 6, 7])[0]
    env.step(some_actions(env, 1)[0])
    again = env.reset(seed=[7, None, None], options={"reset_mask": np.array([True, False, False])})[0]
    np.testing.assert_array_equal(again["self"][0], first["self"][2])
    assert (again["self"][1] != first["self"][1]).any()
    assert env.missions.seeds == [7, 6, 7] and env.missions.episodes == [0, 0, 0]


@pytest.mark.parametrize("starts", AutoresetMode)
def test_where_missions_start_anew_all_do_or_none(
    starts: AutoresetMode, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = EntropyExploreVectorEnv("box-7x11x5", 3, autoreset_mode=starts, max_cycles=2)
    env.reset(seed=0)
    actions = some_actions(env, 3)
    env.step(actions[0])
    if starts is AutoresetMode.NEXT_STEP:
        env.step(actions[1])
    before, real, drawn = snapshot(env), missions.start_poses, []

    def full_at_last(*given: Any) -> np.ndarray:
        drawn.append(given)
        if len(drawn) == 3:
            raise WorldError("Scenario.robots", 2, "fewer")
        return real(*given)

    monkeypatch.setattr(missions, "start_poses", full_at_last)
    if starts is AutoresetMode.DISABLED:
        env.step(actions[1])
        assert not drawn
        return
    with pytest.raises(WorldError):
        env.step(actions[2])
    assert env.missions.episodes == [0, 0, 0]
    if starts is AutoresetMode.NEXT_STEP:
        require_same("refused", before, snapshot(env))
