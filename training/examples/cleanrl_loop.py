"""PPO in CleanRL's form over the batched environment: one file, read from top to bottom."""

from itertools import pairwise, product

import gymnasium
import numpy as np
import torch
from torch import nn

import entropy_explore_env  # noqa: F401 - registers the ids

UPDATES, MISSIONS, ROBOTS, LIMIT_S = 5, 16, 3, 30
GAMMA, LAMBDA, CLIP, EPOCHS, RATE = 0.99, 0.95, 0.2, 6, 3e-3

torch.manual_seed(0)
discrete = {"kind": "discrete", "moves": "axes"}
settings = {"robots": ROBOTS, "observation": {"flat": True}, "action": discrete}
envs = gymnasium.make_vec(
    "entropy_explore_env/Room-v1", MISSIONS, decision_period_s=1.0, time_limit_s=LIMIT_S, **settings
)
observations, infos = envs.reset(seed=0)
numbers, actions = observations.shape[-1], infos["action_mask"].shape[-1]
actor = nn.Sequential(nn.Linear(numbers, 64), nn.Tanh(), nn.Linear(64, actions))
critic = nn.Sequential(nn.Linear(numbers, 64), nn.Tanh(), nn.Linear(64, 1))
weights = [*actor.parameters(), *critic.parameters()]
optimiser = torch.optim.Adam(weights, RATE)


def policy(seen, mask):
    """Return the distribution of actions, without those that the mask forbids."""
    return torch.distributions.Categorical(logits=actor(seen).masked_fill(mask == 0, -1e9))


over, returns = np.zeros(MISSIONS, bool), []
for update in range(UPDATES):
    # A robot that drives cannot choose: choices are stored, each with all that it earned until the next.
    choices = {robot: [] for robot in product(range(MISSIONS), range(ROBOTS))}
    for _ in range(LIMIT_S + 1):  # a mission, and the step that begins the next one
        seen, mask = torch.from_numpy(observations), torch.from_numpy(infos["action_mask"])
        with torch.no_grad():
            drawn, values = policy(seen, mask), critic(seen)[..., 0]
        acted = drawn.sample()
        for at in zip(*np.nonzero(infos["deciding"] & ~over[:, None]), strict=True):
            made = {"seen": seen[at], "mask": mask[at], "action": acted[at], "value": values[at]}
            choices[at].append(made | {"log": drawn.log_prob(acted)[at], "earned": 0.0, "ended": False})
        observations, _, terminated, truncated, infos = envs.step(acted.numpy())
        over = terminated | truncated
        for (mission, robot), made in choices.items():
            if made:
                made[-1]["earned"] += infos["reward_robots"][mission, robot]
                made[-1]["ended"] |= bool(over[mission])
    returns.append(sum(one["earned"] for made in choices.values() for one in made) / len(choices))

    learned = []  # generalised advantages, from choice to choice
    for made in choices.values():
        advantage = 0.0
        for now, later in reversed(list(pairwise([*made, {"value": torch.zeros(())}]))):
            coming = 0.0 if now["ended"] else 1.0
            surprise = now["earned"] + GAMMA * coming * later["value"] - now["value"]
            advantage = surprise + GAMMA * LAMBDA * coming * advantage
            learned.append(now | {"advantage": advantage, "return": advantage + now["value"]})
    batch = {name: torch.stack([torch.as_tensor(one[name]) for one in learned]) for name in learned[0]}
    advantages = (batch["advantage"] - batch["advantage"].mean()) / (batch["advantage"].std() + 1e-8)
    for _ in range(EPOCHS):
        drawn = policy(batch["seen"], batch["mask"])
        ratio = (drawn.log_prob(batch["action"]) - batch["log"]).exp()
        gained = torch.minimum(ratio * advantages, ratio.clamp(1 - CLIP, 1 + CLIP) * advantages).mean()
        missed = (critic(batch["seen"])[..., 0] - batch["return"]).square().mean()
        loss = -gained + 0.5 * missed - 0.001 * drawn.entropy().mean()
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(weights, 0.5)
        optimiser.step()
    print(f"update {update}: {len(learned)} choices, mean return {returns[-1]:.3f}, loss {loss.item():.3f}")
