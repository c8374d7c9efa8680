"""The rows of a Stable-Baselines3 VecEnv are the robots of the missions, and say what became of them."""

from typing import Any

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecEnv

from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.observation import Observation
from tests.envs.pairwise import pairwise

MISSIONS, ROBOTS = 3, 2
SEEDS = [11, 5, 2**70]
FAULTS: dict[str, Any] = {
    "stop": {"at_s": 9.0, "lasts_s": 8.0, "robots": (0,)},
    "blind": {"at_s": 4.0, "lasts_s": 10.0},
    "radio": {"garbled": 0.3, "repeated": 0.3, "late": 0.3, "late_s": 5.0},
}
SHORT: dict[str, Any] = {
    "decision_period_s": None,
    "action": Action("discrete", moves="axes"),
    "observation": Observation(flat=True),
}


def made(robots: int = ROBOTS, **settings: Any) -> RobotVecEnv:
    return RobotVecEnv("box-7x11x5", MISSIONS, seeds=SEEDS, robots=robots, **{**SHORT, **settings})


def actions_of(rows: RobotVecEnv, rng: np.random.Generator) -> np.ndarray:
    if rows.action_space.shape:
        return rng.uniform(-1, 1, (rows.num_envs, *rows.action_space.shape)).astype(np.float32)
    return rng.integers(rows.action_space.n, size=rows.num_envs)  # pyright: ignore


@pytest.mark.parametrize(
    ("robots", "kind", "flat", "faults"),
    pairwise((1, ROBOTS), ("discrete", "continuous"), (True, False), ({}, FAULTS)),
)
def test_rows_are_the_robots_of_the_vector_environment(
    robots: int, kind: Any, flat: bool, faults: dict[str, Any]
) -> None:
    """Row e·A + a is robot a of mission e: what it observes, earns, and when it may choose."""
    settings = {
        "action": Action(kind),
        "observation": Observation(flat=flat),
        "time_limit_s": 30.0,
        "faults": faults,
    }
    rows = made(robots, **settings)
    env = EntropyExploreVectorEnv(
        "box-7x11x5", MISSIONS, robots=robots, autoreset_mode="SameStep", **{**SHORT, **settings}
    )
    assert isinstance(rows, VecEnv) and rows.num_envs == MISSIONS * robots
    seen, rng, ends = rows.reset(), np.random.default_rng(0), 0
    expected, infos = env.reset(seed=SEEDS)
    clock = np.zeros(MISSIONS)
    for _ in range(60):
        for name, part in (seen if isinstance(seen, dict) else {"": seen}).items():
            whole = expected[name] if isinstance(expected, dict) else expected
            for mission in range(MISSIONS):
                for robot in range(robots):
                    there = whole[mission] if robots == 1 else whole[mission, robot]
                    assert (part[mission * robots + robot] == there).all()
        assert (rows.deciding == infos["deciding"].ravel()).all()
        actions, decided = actions_of(rows, rng), rows.deciding.copy()
        shape = (MISSIONS, *([robots] if robots > 1 else []), *actions.shape[1:])
        seen, rewards, dones, told = rows.step(actions)
        expected, _, terminated, truncated, infos = env.step(actions.reshape(shape))
        assert (rewards == infos["reward_robots"].ravel().astype(np.float32)).all()
        over = terminated | truncated
        assert (dones == np.repeat(over, robots)).all()
        now = np.where(over, infos["final_info"]["time_s"] if over.any() else 0.0, infos["time_s"])
        assert np.allclose(rows.elapsed_s, np.repeat(now - clock, robots)) and (rows.decided == decided).all()
        clock = np.where(over, 0.0, infos["time_s"])
        for row, info in enumerate(told):
            assert info["decided"] == decided[row] and info["elapsed_s"] == rows.elapsed_s[row]
            assert ("terminal_observation" in info) == dones[row]
            if dones[row]:
                ends += 1
                mission, robot = divmod(row, robots)
                assert info["TimeLimit.truncated"] == truncated[mission]
                last = infos["final_obs"][mission]
                for name, part in (last if isinstance(last, dict) else {"": last}).items():
                    told_part = info["terminal_observation"]
                    mine = told_part[name] if isinstance(told_part, dict) else told_part
                    assert (mine == (part if robots == 1 else part[robot])).all()
                assert info["episode"]["t"] == infos["final_info"]["time_s"][mission]
    assert ends >= MISSIONS * robots


def test_an_episode_s_return_is_the_sum_of_its_rewards() -> None:
    rows, rng = made(time_limit_s=20.0), np.random.default_rng(1)
    rows.reset()
    sums, steps, seen = np.zeros(rows.num_envs), 0, 0
    for _ in range(80):
        _, rewards, dones, told = rows.step(actions_of(rows, rng))
        sums += rewards
        for row in np.flatnonzero(dones):
            assert told[row]["episode"]["r"] == pytest.approx(sums[row], abs=1e-6)
            assert told[row]["figures"]["t_mission_s"] == told[row]["episode"]["t"]
            seen += 1
        sums[dones] = 0.0
        steps += 1
    assert seen > 0


def test_a_mapped_mission_terminates_and_one_that_ran_out_of_time_is_truncated() -> None:
    kinds = {}
    for limit in (10.0, 10_000.0):
        rows, rng = made(time_limit_s=limit), np.random.default_rng(2)
        rows.reset()
        for _ in range(600):
            _, _, dones, told = rows.step(actions_of(rows, rng))
            if dones.any():
                kinds[limit] = told[int(np.flatnonzero(dones)[0])]["TimeLimit.truncated"]
                break
    assert kinds == {10.0: True, 10_000.0: False}


def test_the_last_observation_of_a_busy_robot_is_whole() -> None:
    """Its value is what a mission that is cut off goes on with."""
    rows, rng = (
        made(time_limit_s=9.7, observation=Observation(flat=True, while_busy=False)),
        np.random.default_rng(4),
    )
    rows.reset()
    last = []
    while not last:
        _, _, dones, told = rows.step(actions_of(rows, rng))
        last = [told[row]["terminal_observation"] for row in np.flatnonzero(dones)]
    assert all(each.any() for each in last)


def test_seeds_are_one_a_mission() -> None:
    rows = made()
    rows.reset()
    assert rows.vector_env.missions.seeds == SEEDS
    rows.seed(7)
    rows.reset()
    assert rows.vector_env.missions.seeds == [7, 8, 9]  # SB3 numbers the rows


def test_rows_have_no_attributes_of_their_own() -> None:
    rows = made()
    assert rows.get_attr("num_envs", [0, 4]) == [MISSIONS, MISSIONS]
    assert rows.env_is_wrapped(object) == [False] * rows.num_envs
    with pytest.raises(SettingError, match="no attributes"):
        rows.set_attr("num_envs", 3)
    with pytest.raises(SettingError, match="no other methods"):
        rows.env_method("reset")
    rows.close()


@pytest.mark.parametrize("action", [Action("discrete", moves="axes"), Action("candidates", candidates=5)])
def test_rows_have_the_masks_of_their_robots(action) -> None:
    rows = made(action=action)
    rows.reset()
    rng = np.random.default_rng(0)
    for _ in range(12):
        masks = rows.env_method("action_masks")
        wanted = rows.vector_env.missions.action_masks().reshape(rows.num_envs, -1) == 1
        assert np.array_equal(masks, wanted) and np.array_equal(rows.action_masks(), wanted)
        assert np.array_equal(rows.env_method("action_masks", indices=[4, 1]), wanted[[4, 1]])
        rows.step((wanted * rng.random(wanted.shape)).argmax(1))
    assert rows.has_attr("action_masks")


def test_rows_whose_actions_are_no_numbers_have_no_masks() -> None:
    rows = made(action=Action())
    assert not rows.has_attr("action_masks")
    with pytest.raises(SettingError, match=r"Action\.kind = 'continuous'"):
        rows.env_method("action_masks")


def test_pictures_of_all_missions_are_rendered():
    rows = RobotVecEnv("box-7x11x5", 2, robots=2, render_mode="rgb_array")
    rows.reset()
    assert rows.render_mode == "rgb_array"
    assert [image.shape for image in rows.get_images()] == [(480, 640, 3)] * 2
    picture = rows.render()
    assert picture is not None and picture.shape == (960, 640, 3)
    rows.close()
    plain = RobotVecEnv("box-7x11x5", 1, robots=2)
    assert plain.render_mode is None and plain.get_images() == []
    plain.close()
