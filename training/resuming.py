"""What a trainer needs to go on bitwise where it was: optimiser, random states, missions under way."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO

from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from training.checkpoints import Checkpoint

_CHANCE = "torch_chance"
_ROWS = "rows."


def keep_training(checkpoint: Checkpoint, model: PPO, rows: RobotVecEnv, numbers: dict[str, Any]) -> None:
    """Put into a checkpoint what going on takes.

    Args:
        checkpoint: Of the policy; its part for the trainer is filled in.
        model: Between two rollouts.
        rows: Where it learns.
        numbers: What else the trainer counts.
    """
    state = model.policy.optimizer.state_dict()["state"]
    checkpoint.tensors = {f"{i}.{name}": each for i, own in state.items() for name, each in own.items()}
    checkpoint.tensors[_CHANCE] = torch.get_rng_state()
    checkpoint.arrays = {_ROWS + name: array for name, array in rows.arrays().items()}
    checkpoint.arrays["last_observations"] = np.asarray(model._last_obs)
    checkpoint.arrays["episode_starts"] = np.asarray(model._last_episode_starts)
    checkpoint.numbers = numbers | {"updates": model._n_updates}


def take_up_training(found: Checkpoint, model: PPO, rows: RobotVecEnv) -> None:
    """Put model and rows where those of a checkpoint were; the policy's weights are another matter.

    Args:
        found: With its part for the trainer.
        model: Of the same settings.
        rows: Likewise.

    Raises:
        RecordError: The missions of the checkpoint do not fit the rows.
    """
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, tensor in found.tensors.items():
        if name != _CHANCE:
            place, _, part = name.partition(".")
            state.setdefault(int(place), {})[part] = tensor
    optimiser = model.policy.optimizer
    optimiser.load_state_dict(optimiser.state_dict() | {"state": state})
    rows.reset()
    rows.set_arrays(
        {name.removeprefix(_ROWS): each for name, each in found.arrays.items() if name.startswith(_ROWS)}
    )
    model._last_obs = found.arrays["last_observations"]
    model._last_episode_starts = found.arrays["episode_starts"]
    model.num_timesteps, model._n_updates = found.progress["steps"], found.numbers["updates"]
    torch.set_rng_state(found.tensors[_CHANCE])
