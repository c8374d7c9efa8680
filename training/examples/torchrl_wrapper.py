"""A team in TorchRL: `PettingZooWrapper` takes infos that are numbers, and a mask of actions among them."""

from pettingzoo.utils import BaseParallelWrapper
from torchrl.envs import PettingZooWrapper

import entropy_explore_env as eee


class NumbersOnly(BaseParallelWrapper):
    """Infos without text: whether a robot decides, and which actions make sense."""

    def reset(self, seed=None, options=None):
        observations, infos = super().reset(seed, options)
        return observations, {a: {k: infos[a][k] for k in ("deciding", "action_mask")} for a in infos}

    def step(self, actions):
        *results, infos = super().step(actions)
        return *results, {a: {k: infos[a][k] for k in ("deciding", "action_mask")} for a in infos}


team = eee.parallel_env("room", robots=3, observation={"flat": True}, action={"kind": "discrete"})
env = PettingZooWrapper(NumbersOnly(team), seed=0)
rollout = env.rollout(100)  # random actions among those that make sense; a policy goes here
# Learn from these actions, (100, 3), only; rewards of a robot's other rows belong to its last one of these.
chosen = rollout["robot", "info", "deciding"] > 0
print(rollout["robot", "observation"].shape, rollout["next", "robot", "reward"].shape, chosen.sum())
