"""One robot under Gymnasium: the same mission as a team of one."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from entropy_explore_env import CallOrderError, SettingError, SingleRobotEnv, environment_id, parallel_env
from entropy_explore_env.envs.conformance import leaves, require_same
from tests.envs.pairwise import pairwise
from tests.envs.test_vector_env import some_actions
from tests.reference.scenes import SMALL

BOX = "box-7x11x5"
KINDS = ("continuous", "discrete")


@pytest.mark.parametrize("scenario", SMALL)
def test_gymnasium_makes_a_robot_that_waits_for_nobody(scenario: str) -> None:
    env = gymnasium.make(environment_id(scenario), max_cycles=20)
    assert isinstance(env.unwrapped, SingleRobotEnv)
    assert env.unwrapped.scenario.robots == 1
    assert env.unwrapped.scenario.decision_period_s is None
    assert env.reset(seed=0)[1]["deciding"]
    for action in some_actions(env, 20):
        *_, truncated, info = env.step(action)
        assert info["deciding"]
    assert truncated


@pytest.mark.parametrize(("scenario", "kind", "period"), pairwise(SMALL, KINDS, (None, 1.0)))
def test_plays_the_same_as_a_team_of_one(scenario: str, kind: str, period: float | None) -> None:
    settings = {
        "action": {"kind": kind},
        "decision_period_s": period,
        "max_cycles": 30,
        "observation": {"patch": True},
    }
    env, team = SingleRobotEnv(scenario, **settings), parallel_env(scenario, robots=1, **settings)
    for seed in (3, None):
        expected = [part["robot_0"] for part in team.reset(seed=seed)]
        require_same("reset", leaves(expected), leaves(list(env.reset(seed=seed))))
        for action in some_actions(env, 30):
            expected = [part["robot_0"] for part in team.step({"robot_0": action})]
            require_same("step", leaves(expected), leaves(list(env.step(action))))
        assert team.agents == []


@pytest.mark.parametrize("robots", [2, 0, None, "1"])
def test_a_team_is_refused(robots: Any) -> None:
    with pytest.raises(SettingError, match="robots"):
        SingleRobotEnv(BOX, robots=robots)
    with pytest.raises(SettingError, match="robots"):
        gymnasium.make(environment_id(BOX), robots=robots)


def test_calls_in_the_wrong_order_are_refused() -> None:
    env = SingleRobotEnv(BOX, max_cycles=2)
    action = np.zeros(5, np.float32)
    env.reset(seed=0)
    env.step(action)
    assert env.step(action)[3] is True
    with pytest.raises(CallOrderError, match="end"):
        env.step(action)
    env.reset()
    env.step(action)


@pytest.mark.parametrize("kind", ["discrete", "candidates"])
def test_masks_are_those_of_infos_through_wrappers(kind):
    env = gymnasium.make(environment_id(BOX), action={"kind": kind})
    _, info = env.reset(seed=3)
    for _ in range(5):
        masks = env.get_wrapper_attr("action_masks")()
        assert masks.dtype == bool and np.array_equal(masks, info["action_mask"] == 1)
        _, _, _, _, info = env.step(int(np.flatnonzero(masks)[-1]))


def test_continuous_actions_have_no_masks():
    with pytest.raises(SettingError, match=r"Action\.kind = 'continuous'"):
        SingleRobotEnv(BOX).action_masks()


def test_its_team_of_one_has_the_map_and_the_world_of_the_mission() -> None:
    env = SingleRobotEnv("box-7x11x5")
    env.reset(seed=0)
    env.team.set_world_block((1.0, 2.0, 0.5), (1.5, 2.5, 1.0))
    world = env.missions.worlds[0]
    assert world is not None and world.occupied.sum() == 1
    assert env.team.joint_map().grid == env.scenario.grid and not env.team.joint_map().known.any()
