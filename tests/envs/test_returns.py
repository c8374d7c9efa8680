"""Returns of the named scenarios tell fast from slow; loggers of episodes show mission times."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import RecordEpisodeStatistics
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor

from baselines import mission_times
from baselines.cli.task_options import base_task, tasked
from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import make_strategy
from entropy_explore_env.envs.infos import END_FIGURES
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX, MISSION_TIMES, SCENARIOS, find_scenario
from entropy_explore_env.settings import Reward

SHORT = {"robots": 2, "time_limit_s": 6.0, "action": {"kind": "discrete", "moves": "axes"}}


def test_a_second_costs_a_fifth_over_the_median_mission_time():
    assert set(MISSION_TIMES) == set(SCENARIOS)
    for name, times in MISSION_TIMES.items():
        assert SCENARIOS[name].reward.kind == "team"
        assert SCENARIOS[name].reward.cost_per_s == pytest.approx(0.2 / times.median_s, rel=5e-3)
        assert times.strategy == mission_times.reference(name)


@pytest.mark.parametrize("robots", [2, 1])
def test_a_mission_as_long_as_the_median_returns_about_four_fifths(robots):
    env, returns, times_s = EntropyExploreEnv("box-7x11x5", **scripted_settings(), robots=robots), [], []
    step = env.step
    for strategy, seeds in (("information-rate-v0", range(5)), ("random", range(5))):
        for seed in seeds:
            earned = []

            def counted(actions, earned=earned):
                stepped = step(actions)
                earned.append(np.mean(list(stepped[1].values())))
                return stepped

            env.step = counted
            run_mission(env, make_strategy(strategy), seed)
            returns.append(sum(earned))
            times_s.append(float(env.missions.state.missions[0]["time_s"]))
    assert 0.7 < np.median(returns[:5]) < 0.9
    times = MISSION_TIMES["box-7x11x5"]
    slower = np.array(times_s) / (times.median_s if robots == 2 else times.alone_s)
    np.testing.assert_allclose(returns, 1.0 - 0.2 * slower, atol=0.05)  # by what comes beyond the threshold


def scripted_settings():
    """Nothing observed, steps until a decision."""
    made = scripted(BOX)
    return {"decision_period_s": made.decision_period_s, "observation": made.observation}


def test_one_robot_pays_by_its_own_median():
    measured = {name: times.alone_s for name, times in MISSION_TIMES.items() if times.alone_s is not None}
    assert {"room", "office", "cave"} < set(measured)
    for name, alone_s in measured.items():
        assert alone_s > MISSION_TIMES[name].median_s and SCENARIOS[name].robots > 1
        assert find_scenario(name, 1).reward.cost_per_s == pytest.approx(0.2 / alone_s, rel=5e-3)
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
    options = base_task("room").defaults(None)
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
