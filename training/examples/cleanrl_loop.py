"""A loop in CleanRL's form over the batched environment: what to store, and what not to learn from."""

import gymnasium
import numpy as np
import torch

import entropy_explore_env  # noqa: F401 - registers the ids

settings = {"robots": 3, "observation": {"flat": True}, "action": {"kind": "discrete"}}
envs = gymnasium.make_vec("entropy_explore_env/Room-v1", num_envs=4, decision_period_s=1.0, **settings)
observations, infos = envs.reset(seed=0)
policy = torch.nn.Linear(observations.shape[-1], infos["action_mask"].shape[-1])
rollout, over, latest = [], np.zeros(4, bool), {}
for step in range(64):
    logits = policy(torch.from_numpy(observations)).masked_fill(
        torch.from_numpy(infos["action_mask"]) == 0, -1e9
    )
    actions = torch.distributions.Categorical(logits=logits).sample().numpy()  # (4, 3): missions, robots
    chosen = infos["deciding"] & ~over[:, None]  # busy robots' actions, and those after an end, are ignored
    after, _, terminations, truncations, infos = envs.step(actions)
    latest |= {
        (e, a): step for e, a in np.argwhere(chosen).tolist()
    }  # what a drive brings comes when it ends:
    earned = np.zeros((4, 3))  # a busy robot's rewards belong to its latest choice
    rollout.append((observations, actions, chosen, earned, terminations, truncations))
    for (mission, robot), choice in latest.items():
        rollout[choice][3][mission, robot] += infos["reward_robots"][mission, robot]
    observations, over = after, terminations | truncations
print(len(rollout), "steps,", sum(int(chosen.sum()) for _, _, chosen, *_ in rollout), "choices to learn from")
