"""Many missions at once: as Gymnasium's own vector environment would play them, in every autoreset mode."""

import sys
from types import FrameType
from typing import Any

import gymnasium
import numpy as np
import pygame
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import batch_space

from entropy_explore_env import (
    CallOrderError,
    EntropyExploreVectorEnv,
    SettingError,
    SingleRobotEnv,
    environment_id,
    find_scenario,
    parallel_env,
)
from entropy_explore_env.envs.conformance import leaves, require_same, snapshot
from tests.reference.scenes import SMALL

BOX = "box-7x11x5"
KINDS = ("continuous", "discrete")
UNEVEN: dict[str, Any] = {"decision_period_s": None, "time_limit_s": 20.0}
"""Steps last as long as drives do, so that missions end at different steps."""
ROBOT_INFOS = ("deciding", "entropy_bits", "own_bits", "received_bits", "reward_robots")


def some_actions(env: Any, steps: int, seed: int = 0) -> list[Any]:
    env.action_space.seed(seed)
    return [env.action_space.sample() for _ in range(steps)]


def in_order(value: Any) -> Any:
    """Gymnasium's vector environment sorts the parts of an observation by name."""
    return dict(sorted(value.items())) if isinstance(value, dict) else value


@pytest.mark.parametrize("scenario", SMALL)
def test_gymnasium_makes_many_missions_by_id(scenario: str) -> None:
    env = gymnasium.make_vec(environment_id(scenario), num_envs=6, max_cycles=9)
    assert isinstance(env, EntropyExploreVectorEnv)
    assert env.num_envs == 6 and env.spec is not None and env.spec.id == environment_id(scenario)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    single = gymnasium.make(environment_id(scenario))
    assert env.single_observation_space == single.observation_space
    assert env.single_action_space == single.action_space
    assert env.action_space == batch_space(single.action_space, 6)
    assert env.observation_space == batch_space(single.observation_space, 6)
    assert env.observation_space.contains(env.reset(seed=0)[0])
    env.close()
    env.close()


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_plays_as_gymnasium_s_own_vector_environment_does(mode: AutoresetMode, kind: str, flat: bool) -> None:
    """Seeds, observations, rewards, ends, final observations: the same bits, over several episodes."""
    settings = {"action": {"kind": kind}, "observation": {"flat": flat, "action_mask": True}, **UNEVEN}
    ours = EntropyExploreVectorEnv(BOX, 5, robots=1, threads=2, autoreset_mode=mode, **settings)
    theirs = SyncVectorEnv([lambda: SingleRobotEnv(BOX, **settings)] * 5, autoreset_mode=mode)
    first, reference = ours.reset(seed=11), theirs.reset(seed=11)
    require_same("reset", leaves(in_order(reference[0])), leaves(in_order(first[0])))
    ends = []
    for step, actions in enumerate(some_actions(ours, 60)):
        found, expected = ours.step(actions), theirs.step(actions)
        for mine, other in zip(found[:4], expected[:4], strict=True):
            require_same(f"step {step}", leaves(in_order(other)), leaves(in_order(mine)))
        assert_infos_agree(expected[4], found[4])
        ends.append(found[2] | found[3])
    assert 3 <= np.sum(ends, axis=0).min()
    assert any(0 < sum(row) < 5 for row in ends)


def assert_infos_agree(expected: dict[str, Any], found: dict[str, Any]) -> None:
    """What one robot is told is the same, in the same shape."""
    assert found["_time_s"].dtype == np.bool_ and found["_time_s"].all()
    np.testing.assert_array_equal(found["time_s"], expected["time_s"])
    for name in ("deciding", "entropy_bits", "own_bits", "received_bits"):
        np.testing.assert_array_equal(found[name], expected[name])
    assert ("final_obs" in found) == ("final_obs" in expected)
    if "final_obs" in expected:
        mask = expected["_final_obs"]
        np.testing.assert_array_equal(found["_final_obs"], mask)
        np.testing.assert_array_equal(found["_final_info"], mask)
        for mine, other in zip(found["final_obs"], expected["final_obs"], strict=True):
            assert (mine is None) == (other is None)
            if other is not None:
                require_same("final_obs", leaves(in_order(other)), leaves(in_order(mine)))
        for name in ("time_s", "entropy_bits"):
            mine = found["final_info"][name]
            np.testing.assert_array_equal(mine[mask], expected["final_info"][name][mask])
            np.testing.assert_array_equal(found["final_info"][f"_{name}"], mask)


@pytest.mark.parametrize("kind", KINDS)
def test_a_team_has_an_axis_of_its_own(kind: str) -> None:
    env = EntropyExploreVectorEnv(BOX, 3, robots=4, action={"kind": kind}, observation={"action_mask": True})
    observations, infos = env.reset(seed=0)
    team = parallel_env(BOX, robots=4, action={"kind": kind}, observation={"action_mask": True})
    space = team.observation_space("robot_0")
    assert isinstance(space, gymnasium.spaces.Dict)
    for name, part in space.items():
        assert observations[name].shape == (3, 4, *(part.shape or ()))
        assert observations[name].dtype == part.dtype
    actions = some_actions(env, 1)[0]
    assert actions.shape == ((3, 4) if kind == "discrete" else (3, 4, 5))
    observations, rewards, terminations, truncations, infos = env.step(actions)
    assert env.observation_space.contains(observations)
    assert (rewards.shape, rewards.dtype) == ((3,), np.float64)
    assert terminations.shape == truncations.shape == (3,)
    assert terminations.dtype == truncations.dtype == np.bool_
    np.testing.assert_allclose(rewards, infos["reward_robots"].mean(axis=1), rtol=1e-15)
    for name in ROBOT_INFOS:
        assert infos[name].shape == (3, 4), name
    for name in ("time_s", "end"):
        assert infos[name].shape == (3,), name
    masks = {name: value for name, value in infos.items() if name.startswith("_")}
    assert set(masks) == {f"_{name}" for name in infos if not name.startswith("_")}
    assert all(mask.dtype == np.bool_ and mask.shape == (3,) and mask.all() for mask in masks.values())


@pytest.mark.parametrize("robots", [1, 3])
def test_infos_hold_the_masks_of_discrete_actions_where_they_are_wanted(robots: int) -> None:
    settings = {"robots": robots, "action": {"kind": "discrete"}, "observation": {"action_mask": True}}
    observations, infos = EntropyExploreVectorEnv(BOX, 2, **settings).reset(seed=0)
    mask = infos["action_mask"]
    assert mask.dtype == np.int8
    np.testing.assert_array_equal(mask.reshape(-1), observations["action_mask"].reshape(-1))
    _, without = EntropyExploreVectorEnv(BOX, 2, action_masks=False, **settings).reset(seed=0)
    assert set(infos) - set(without) == {"action_mask", "_action_mask"}


BAD_SEEDS = [[1], [1, 2, 3], [1, -1], -1, 0.5, "12", True, [0, True], [0, 0.5], np.array([0.0, 1.0])]
BAD_MASKS = [None, [1, 0], np.array([True]), np.zeros(2, bool), np.ones((2, 1), bool), "10"]


@pytest.mark.parametrize(
    ("said", "given"),
    [
        *(("seed", {"seed": seed}) for seed in BAD_SEEDS),
        *(("reset_mask", {"options": {"reset_mask": mask}}) for mask in BAD_MASKS),
    ],
)
def test_bad_seeds_and_reset_masks_are_refused_and_change_nothing(said: str, given: dict[str, Any]) -> None:
    env = EntropyExploreVectorEnv(BOX, 2)
    env.reset(seed=0)
    before = snapshot(env)
    with pytest.raises(SettingError, match=said):
        env.reset(**given)
    require_same("refused", before, snapshot(env))


def test_the_first_reset_is_of_all_missions() -> None:
    env = EntropyExploreVectorEnv(BOX, 2)
    with pytest.raises(CallOrderError, match="first reset"):
        env.reset(seed=0, options={"reset_mask": np.array([True, False])})
    assert env.missions.episodes == [-1, -1]


def test_a_reset_of_other_missions_leaves_the_picture_of_the_first() -> None:
    env = EntropyExploreVectorEnv(BOX, 2, render_mode="rgb_array")
    env.reset(seed=0)
    for actions in some_actions(env, 5):
        env.step(actions)
    before: Any = env.render()
    env.reset(options={"reset_mask": np.array([False, True])})
    after: Any = env.render()
    np.testing.assert_array_equal(after[0], before[0])
    assert (after[1] != before[1]).any()


def test_each_mission_has_a_picture_and_the_window_shows_the_first() -> None:
    env = gymnasium.make_vec(environment_id(BOX), num_envs=2, render_mode="rgb_array")
    alone = gymnasium.make(environment_id(BOX), render_mode="rgb_array")
    env.reset(seed=0)
    alone.reset(seed=0)
    pictures: Any = env.render()
    assert isinstance(pictures, tuple) and len(pictures) == 2
    assert all(picture.shape == (480, 640, 3) and picture.dtype == np.uint8 for picture in pictures)
    np.testing.assert_array_equal(pictures[0], alone.render())  # type: ignore[arg-type]
    assert (pictures[0] != pictures[1]).any()
    window = EntropyExploreVectorEnv(BOX, 2, render_mode="human")
    window.reset(seed=0)
    assert window.render() is None and pygame.display.get_surface() is not None
    window.close()
    assert pygame.display.get_surface() is None


def test_gymnasium_s_limit_of_steps_cuts_missions_off_only_where_it_is_asked_for() -> None:
    name = environment_id(BOX)
    usual = gymnasium.make_vec(name, 2)
    assert usual.unwrapped.scenario.ending == find_scenario(BOX).ending  # type: ignore[attr-defined]
    for limit, cycles in ((-1, None), (None, None), (3, 3)):
        made = gymnasium.make_vec(name, 2, max_episode_steps=limit)
        assert made.unwrapped.scenario.ending.max_cycles == cycles  # type: ignore[attr-defined]
    made.reset(seed=0)
    truncated = [made.step(made.action_space.sample())[3].tolist() for _ in range(3)]
    assert truncated == [[False] * 2, [False] * 2, [True] * 2]
    with pytest.raises(SettingError, match="max_cycles = 0"):
        gymnasium.make_vec(name, 2, max_episode_steps=0)


def calls_of_a_step(missions: int) -> int:
    """Return the calls of Python and C functions in one step."""
    env = EntropyExploreVectorEnv(BOX, missions)
    env.reset(seed=0)
    actions, count = env.action_space.sample(), 0
    env.step(actions)

    def note(frame: FrameType, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        env.step(actions)
    finally:
        sys.setprofile(None)
    return count


def test_a_step_of_more_missions_takes_no_more_calls() -> None:
    assert 0 < calls_of_a_step(16) == calls_of_a_step(64)
