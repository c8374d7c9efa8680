"""PPO of Stable-Baselines3 on a team: every robot of every mission is a row, one network drives them all."""

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

from entropy_explore_env.envs.infos import END_FIGURES
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv

rows = RobotVecEnv(
    "box-7x11x5",
    missions=4,
    robots=2,
    observation={"flat": True, "panorama_utility": "log2"},
    action={"kind": "discrete", "moves": "axes"},
    decision_period_s=1.0,
)
env = VecMonitor(rows, info_keywords=END_FIGURES)  # logs mission times, and bits gained per bit sent
policy = PPO("MlpPolicy", env, n_steps=64, batch_size=128, n_epochs=2, seed=0, device="cpu")
policy.learn(total_timesteps=1024)  # a million or more to learn something
observations: np.ndarray = rows.reset()  # (8, F), a row for each robot of each mission
actions, _ = policy.predict(observations)
_, rewards, dones, infos = rows.step(actions)
print(observations.shape, rewards, [info["decided"] for info in infos])
