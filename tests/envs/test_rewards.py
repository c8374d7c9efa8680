"""A reward of one's own: the figures of a step by hand, in every adapter, and what must not depend on it."""

import copy
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from entropy_explore_env import SettingError, SingleRobotEnv, StepFigures, parallel_env
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.reports.mission_record import CommandRecorder
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.sensor import RangeSensor
from tests.envs.bad_values import Unprintable

FAST = Robot(max_speed_m_s=0.5, acceleration_m_s2=0.5, reach_m=1.0, body_radius_m=0.1)
SLOW = Robot(max_speed_m_s=0.125, acceleration_m_s2=0.125, reach_m=1.0, body_radius_m=0.1)
SENSOR = RangeSensor(scan_time_s=0.5)
BOX: dict[str, Any] = {
    "scenario": "box-7x11x5",
    "robots": 2,
    "robot": FAST,
    "sensor": SENSOR,
    "extra_kinds": (RobotKind(SLOW, SENSOR),),
    "decision_period_s": 1.0,
}
STARTS = np.array([[0.75, 0.75, 0.75, 0.0, 0.0], [0.75, 3.75, 0.75, 0.0, 0.0]])
"""Two robots that look along x, 3 m apart in a box of 3.5 m × 5.5 m × 2.5 m."""
AHEAD = np.array([[1.0, 0.0, 0.0, 0.0, 0.0]] * 2, np.float32)
"""A metre along x for each, so far as its reach goes, without turning."""

SEEN: list[StepFigures] = []


@pytest.fixture(autouse=True)
def nothing_seen() -> Iterator[None]:
    SEEN.clear()
    yield
    SEEN.clear()


def weighed(figures: StepFigures) -> np.ndarray:
    """Every figure with a weight of its own, so that exchanged ones show."""
    SEEN.append(figures)
    return (
        figures.gained_bits
        + 3.0 * figures.received_bits
        - 50.0 * figures.distance_m
        - 7.0 * figures.elapsed_s
        - 0.125 * figures.bits_sent
        + 1000.0 * figures.ended
    )


def test_metres_seconds_and_bits_of_drives_by_hand() -> None:
    """A metre at 0.5 m/s²: ½·a·t² = 0.25 m after 1 s, 0.75 m after 2 s, 1 m after 3 s; then a scan."""
    team = parallel_env(**BOX, reward_function=weighed)
    team.reset(seed=0, options={"starts": STARTS})
    driven_m = [
        [0.25, 0.0625],
        [0.5, 0.125],
        [0.25, 0.125],
        [0.0, 0.125],
    ]  # slow: at top speed, 0.125 m/s, from 1 s on
    missions, sent = team.missions, np.zeros(2)
    for expected_m in driven_m:
        rewards = team.step(dict(zip(team.agents, AHEAD, strict=True)))[1]
        figures, robots = SEEN[-1], missions.state.robots[0]
        np.testing.assert_allclose(figures.distance_m, [expected_m], rtol=1e-12)
        np.testing.assert_array_equal(figures.elapsed_s, [[1.0, 1.0]])
        np.testing.assert_array_equal(figures.gained_bits, robots["own_bits"][None])
        np.testing.assert_array_equal(figures.received_bits, robots["received_bits"][None])
        np.testing.assert_array_equal(figures.bits_sent, [robots["bits_sent"] - sent])
        assert figures.ended.tolist() == [[False, False]] and figures.ended.dtype == bool
        assert list(rewards.values()) == weighed(figures)[0].tolist()
        SEEN.pop()
        sent = robots["bits_sent"].astype(float)
    gained, received, sent = (np.sum([figures[k] for figures in SEEN], axis=0) for k in (0, 1, 4))
    assert gained[0, 0] > 0.0 and received[0, 1] > 0.0 and sent[0, 0] > 384.0, "the fast one shared its scan"
    assert gained[0, 1] == received[0, 0] == 0.0 and sent[0, 1] == 384.0, "the slow one only announced"


def actions_of(step: int, shape: tuple[int, ...]) -> np.ndarray:
    return np.random.default_rng(step).uniform(-1, 1, shape).astype(np.float32)


def rewards_of_team(seed: int, steps: int, **settings: Any) -> list[list[float]]:
    """(steps, A) rewards of a ParallelEnv that starts anew when its mission is over."""
    team, rewards = parallel_env(**{**BOX, **settings}, reward_function=weighed), []
    team.reset(seed=seed)
    for step in range(steps):
        if not team.agents:
            team.reset()
        actions = actions_of(step, (8, 2, 5))[seed]
        rewards.append(list(team.step(dict(zip(team.agents, actions, strict=True)))[1].values()))
    return rewards


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_rewards_of_vector_environments_where_missions_start_anew(mode: AutoresetMode) -> None:
    """Mission e earns what a ParallelEnv does; a step that only starts it anew earns nothing."""
    batch = EntropyExploreVectorEnv(
        **{**BOX, "time_limit_s": 4.5}, num_envs=3, autoreset_mode=mode, reward_function=weighed
    )
    fresh = [parallel_env(**BOX, time_limit_s=4.5, reward_function=weighed) for _ in range(3)]
    batch.reset(seed=0)
    for e, team in enumerate(fresh):
        team.reset(seed=e)
    anew = 0
    for step in range(14):
        actions = actions_of(step, (3, 2, 5))
        SEEN.clear()
        _, rewards, _, truncations, infos = batch.step(actions)
        together = SEEN[0]
        assert together.ended.shape == (3, 2)
        for e, team in enumerate(fresh):
            if team.agents:
                alone = team.step(dict(zip(team.agents, actions[e], strict=True)))[1]
                assert infos["reward_robots"][e].tolist() == list(alone.values())
                assert rewards[e] == np.mean(list(alone.values()))
                for mine, theirs in zip(SEEN[-1], together, strict=True):
                    np.testing.assert_array_equal(mine[0], theirs[e])
                assert together.ended[e].all() == truncations[e] == (not team.agents)
                if mode is AutoresetMode.SAME_STEP and not team.agents:
                    team.reset()
                    anew += 1
            else:
                assert rewards[e] == 0.0 and not infos["reward_robots"][e].any()
                assert not any(figure[e].any() for figure in together)
                team.reset()
                anew += 1
    assert anew >= 6


def test_rows_of_stable_baselines3_and_a_single_robot() -> None:
    rows = RobotVecEnv(BOX["scenario"], 2, seeds=[0, 1], reward_function=weighed, **without_scenario())
    rows.reset()
    expected = [rewards_of_team(seed, 3) for seed in (0, 1)]
    for step in range(3):
        rewards = rows.step(actions_of(step, (8, 2, 5))[:2].reshape(4, 5))[1]
        assert rewards.tolist() == np.float32([expected[0][step], expected[1][step]]).ravel().tolist()
    alone = SingleRobotEnv("box-7x11x5", robot=FAST, decision_period_s=1.0, reward_function=weighed)
    alone.reset(seed=0, options={"starts": STARTS[:1]})
    reward = alone.step(AHEAD[0])[1]
    assert isinstance(reward, float) and SEEN[-1].distance_m.tolist() == [[0.25]]
    assert reward == weighed(SEEN[-1]).item()


def without_scenario() -> dict[str, Any]:
    return {name: value for name, value in BOX.items() if name != "scenario"}


@pytest.mark.parametrize(
    "wrong",
    [3.0, "text", None, [[1.0], [2.0, 3.0]], np.zeros((2, 1)), [[True, False]], Unprintable()],
)
def test_what_is_no_reward_is_refused_by_name(wrong: Any) -> None:
    team = parallel_env(**BOX, reward_function=lambda figures: wrong)
    team.reset(seed=0)
    with pytest.raises(SettingError, match=r"reward_function .*lambda.*finite numbers of shape \(1, 2\)"):
        team.step(dict(zip(team.agents, AHEAD, strict=True)))


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_rewards_are_finite(wrong: float) -> None:
    batch = EntropyExploreVectorEnv(**BOX, num_envs=2, reward_function=lambda f: f.elapsed_s + wrong)
    batch.reset(seed=0)
    with pytest.raises(SettingError, match=r"reward_function .*finite numbers of shape \(2, 2\)"):
        batch.step(np.stack([AHEAD, AHEAD]))


def test_what_cannot_be_called_is_refused_and_whole_numbers_are_rewards() -> None:
    with pytest.raises(SettingError, match="reward_function = 3"):
        parallel_env(**BOX, reward_function=3)  # type: ignore[arg-type]
    team = parallel_env(**BOX, reward_function=lambda figures: [[1, 2]])
    team.reset(seed=0)
    assert team.step(dict(zip(team.agents, AHEAD, strict=True)))[1] == {"robot_0": 1.0, "robot_1": 2.0}


def test_the_state_and_the_record_of_a_mission_do_not_depend_on_the_reward() -> None:
    records = []
    for function in (None, weighed):
        team = parallel_env(**BOX, reward_function=function)
        team.reset(seed=0)
        recorder = CommandRecorder(team.missions)
        for step in range(4):
            actions = dict(zip(team.agents, actions_of(step, (2, 5)), strict=True))
            recorder.command(actions)
            team.step(actions)
        records.append(recorder.record())
    assert records[0].digest == records[1].digest
    assert [record.reward_function for record in records] == ["", f"{__name__}.weighed"]


def test_environments_pickle_with_a_function_of_a_module_and_copy_with_any() -> None:
    team = parallel_env(**BOX, reward_function=weighed)
    team.reset(seed=0)
    actions = dict(zip(team.agents, AHEAD, strict=True))
    for other in (pickle.loads(pickle.dumps(team)), copy.deepcopy(team)):
        assert other.step(actions)[1] == copy.deepcopy(team).step(actions)[1]
    unnamed = parallel_env(**BOX, reward_function=lambda figures: 2.0 * figures.elapsed_s)
    unnamed.reset(seed=0)
    assert copy.deepcopy(unnamed).step(actions)[1] == {"robot_0": 2.0, "robot_1": 2.0}
    with pytest.raises(SettingError, match=r"reward_function.*lambda.*top level of a module"):
        pickle.dumps(unnamed)
