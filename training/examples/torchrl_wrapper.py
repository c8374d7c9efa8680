"""PPO for a team in TorchRL: `PettingZooWrapper` makes tensors of infos, and finds the mask of actions.

With the word `candidates` robots choose among viewpoints that a planner proposes.
"""

import sys
from typing import Any

import torch
from tensordict import TensorDict
from tensordict.nn import InteractionType, TensorDictModule
from torch import nn
from torchrl.envs import PettingZooWrapper
from torchrl.modules import MaskedCategorical, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value.functional import generalized_advantage_estimate

import entropy_explore_env as eee

UPDATES, MISSIONS, EPOCHS, GAMMA, LAMBDA = 3, 4, 6, 0.99, 0.95


torch.manual_seed(0)
moves: Any = {"kind": "discrete", "moves": "axes"}
action: Any = {"kind": "candidates"} if "candidates" in sys.argv[1:] else moves
team = eee.parallel_env("room", robots=3, observation={"flat": True}, action=action, time_limit_s=30.0)
env = PettingZooWrapper(team, seed=0)
numbers = env.observation_spec["robot", "observation"].shape[-1]
actions = env.observation_spec["robot", "action_mask"].shape[-1]
scores = nn.Sequential(nn.Linear(numbers, 64), nn.Tanh(), nn.Linear(64, actions))
inputs: Any = {"logits": "logits", "mask": "action_mask"}
actor = ProbabilisticActor(  # one policy for all robots
    TensorDictModule(scores, ["observation"], ["logits"]),
    in_keys=inputs,
    distribution_class=MaskedCategorical,
    return_log_prob=True,
    default_interaction_type=InteractionType.RANDOM,  # a rollout would take the likeliest action
)
critic = ValueOperator(nn.Sequential(nn.Linear(numbers, 64), nn.Tanh(), nn.Linear(64, 1)), ["observation"])
loss_module = ClipPPOLoss(actor, critic, entropy_coeff=0.001)
optimiser = torch.optim.Adam(loss_module.parameters(), 3e-3)


def choose(step: TensorDict) -> TensorDict:
    """Return the team's actions: what the wrapper holds of the robots is a batch of its own."""
    return step.set("robot", actor(step["robot"]))


def choices_of(rollout: TensorDict) -> list[TensorDict]:
    """Return what each robot chose, with advantages from choice to choice: driving robots cannot choose."""
    found = []
    for robot in range(rollout["robot"].shape[1]):
        rows: Any = rollout["robot"][:, robot]
        rewards = rollout["next", "robot", "reward"][:, robot, 0]
        chosen = rows["info", "deciding"] > 0
        latest = chosen.cumsum(0) - 1  # rewards of a robot's other rows belong to its latest choice
        made = rows[chosen].clone()
        earned = torch.zeros(len(made)).index_add(0, latest, rewards)[:, None]
        values = critic(made)["state_value"].detach()
        after = torch.cat([values[1:], torch.zeros(1, 1)])
        ended = torch.zeros(len(made), 1, dtype=torch.bool)
        ended[-1] = True
        advantage, target = generalized_advantage_estimate(GAMMA, LAMBDA, values, after, earned, ended)
        found.append(made.update({"advantage": advantage, "value_target": target}))
    return found


returns = []
for update in range(UPDATES):
    with torch.no_grad():
        rollouts = [env.rollout(100, choose) for _ in range(MISSIONS)]
    returns.append(sum(float(one["next", "robot", "reward"].sum(0).mean()) for one in rollouts) / MISSIONS)
    batch = torch.cat([made for one in rollouts for made in choices_of(one)])
    for _ in range(EPOCHS):
        losses = loss_module(batch)
        loss = losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(loss_module.parameters(), 0.5)
        optimiser.step()
    print(f"update {update}: {len(batch)} choices, mean return {returns[-1]:.3f}, loss {loss.item():.3f}")
