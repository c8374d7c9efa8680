"""Missions of a vector environment start anew by themselves, or by a mask, as Gymnasium says."""

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
from entropy_explore_env.envs.conformance import leaves, require_same, snapshot
from entropy_explore_env.missions import episode as missions
from tests.envs.test_vector_env import BOX, UNEVEN, some_actions


@pytest.mark.parametrize("mode", [*AutoresetMode, *(mode.value for mode in AutoresetMode)])
def test_metadata_name_the_autoreset_mode(mode: AutoresetMode | str) -> None:
    env = gymnasium.make_vec(environment_id(BOX), num_envs=2, autoreset_mode=mode)
    assert env.metadata["autoreset_mode"] is AutoresetMode(mode)
    default = EntropyExploreVectorEnv(BOX, 2)
    assert default.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


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


@pytest.mark.parametrize("starts", [*AutoresetMode, None])
def test_where_missions_start_anew_all_do_or_none(
    starts: AutoresetMode | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By themselves in a mode, or with None by a reset."""
    mode = starts or AutoresetMode.NEXT_STEP
    env = EntropyExploreVectorEnv("box-7x11x5", 3, autoreset_mode=mode, max_cycles=2)
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
        env.step(actions[2]) if starts else env.reset(seed=5)
    assert env.missions.episodes == [0, 0, 0]
    if starts is not AutoresetMode.SAME_STEP:
        require_same("refused", before, snapshot(env))
