"""Returns of the named scenarios tell fast from slow; loggers of episodes show mission times."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import RecordEpisodeStatistics
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor

from baselines.cli.task_options import base_task, tasked
from entropy_explore_env.envs.infos import END_FIGURES
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.reward import Reward
from entropy_explore_env.settings.scenarios import BOX, COST_PER_S_ALONE, SCENARIOS, find_scenario

SHORT = {"robots": 2, "time_limit_s": 6.0, "action": {"kind": "discrete", "moves": "axes"}}


def test_every_named_scenario_has_the_teams_reward_and_a_cost_of_its_own():
    assert all(scenario.reward.kind == "team" for scenario in SCENARIOS.values())
    assert all(1e-5 < scenario.reward.cost_per_s < 0.02 for scenario in SCENARIOS.values())
    assert SCENARIOS["room"].reward.cost_per_s == 0.00606  # 0.2 / 33 s


def test_one_robot_alone_pays_less():
    assert {"room", "office", "cave"} < set(COST_PER_S_ALONE) < set(SCENARIOS)
    for name, cost_per_s in COST_PER_S_ALONE.items():
        assert cost_per_s < SCENARIOS[name].reward.cost_per_s and SCENARIOS[name].robots > 1
        assert find_scenario(name, 1).reward == Reward("team", cost_per_s)
        assert find_scenario(name, 2) is find_scenario(name) is SCENARIOS[name]
    team, alone = SCENARIOS["room"].reward, find_scenario("room", 1).reward
    environments: list[tuple[Any, Reward]] = [
        (gymnasium.make("entropy_explore_env/Room-v1").unwrapped, alone),
        (gymnasium.make_vec("entropy_explore_env/Room-v1", num_envs=2).unwrapped, alone),
        (gymnasium.make_vec("entropy_explore_env/Room-v1", num_envs=2, robots=3).unwrapped, team),
        (EntropyExploreEnv("room", robots=1), alone),
        (EntropyExploreEnv("room"), team),
        (EntropyExploreEnv("room", robots=1, reward={"cost_per_s": 0.5}), Reward("team", 0.5)),
    ]
    for made, wanted in environments:
        assert made.scenario.reward == wanted
    options = base_task("room").defaults()
    for scenario, robots, wanted in (
        (SCENARIOS["room"], 1, alone),
        (SCENARIOS["room"], 2, team),
        (with_settings(SCENARIOS["room"], {"reward": {"cost_per_s": 0.5}}), 1, Reward("team", 0.5)),
    ):
        assert tasked(scenario, options, robots)[0].reward == wanted


def test_gymnasium_and_stable_baselines_show_mission_time_and_bits_per_bit():
    made = gymnasium.make("entropy_explore_env/Box7x11x5-v1", time_limit_s=6.0)
    env, over = Monitor(RecordEpisodeStatistics(made), info_keywords=END_FIGURES), False
    env.reset(seed=0)
    env.action_space.seed(0)
    info = {}
    while not over:
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        over = terminated or truncated
    assert info["episode"]["t_mission_s"] == info["t_mission_s"] == info["time_s"] == 6.0
    assert np.isnan(info["episode"]["bits_gained_per_bit_sent"])  # alone, it sends nothing
    rows = VecMonitor(RobotVecEnv(BOX, 2, **SHORT), info_keywords=END_FIGURES)
    rows.seed(0)
    rows.reset()
    infos, dones = [], np.zeros(4, bool)
    while not dones.any():
        _, _, dones, infos = rows.step(np.zeros(4, np.int64))
    for row in np.flatnonzero(dones):
        figures = infos[row]["figures"]
        assert infos[row]["episode"]["t_mission_s"] == figures["t_mission_s"]
        assert infos[row]["episode"]["bits_gained_per_bit_sent"] == pytest.approx(
            figures["bits_gained_per_bit_sent"] or np.nan, nan_ok=True
        )
    many = EntropyExploreVectorEnv(BOX, 2, time_limit_s=6.0)
    many.reset(seed=0)
    ended = np.zeros(2, bool)
    while not ended.any():
        *_, ended, told = many.step(np.zeros(many.action_space.shape, np.float32))
    assert (told["_t_mission_s"] == ended).all() and (told["t_mission_s"][ended] == 6.0).all()
