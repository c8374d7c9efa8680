"""A training run's state, and how a checkpoint saves and restores all of it, bit for bit."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO

from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from training.advantages import DecisionBuffer
from training.checkpoints import (
    Checkpoint,
    PolicySettings,
    TrainerState,
    forget_later,
    latest_checkpoint,
    load_checkpoint,
)
from training.errors import CheckpointError
from training.normalisation import Normaliser
from training.options import check_new
from training.policy import POLICIES, check_same_networks, load_weights, weights_of
from training.progress import Progress
from training.run_folder import FILE

_TORCH_RNG = "torch_chance"  # names in files of every version
_SHUFFLE_RNG = "chance"
_ENVS = "rows."
_COUNTERS = ("best", "curve", "next_validation", "next_checkpoint")


@dataclass
class TrainingState:
    """Everything that training changes.

    Attributes:
        settings: Of the policy.
        model: Policy, optimiser and counters.
        envs: The missions that are under way.
        observation_stats: Mean and deviation of the observations that were learned from.
        progress: How far the run is.
        command: What the run was started with.
        options: Those of the command, as JSON holds them.
    """

    settings: PolicySettings
    model: PPO
    envs: RobotVecEnv
    observation_stats: Normaliser
    progress: Progress
    command: str = ""
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def buffer(self) -> DecisionBuffer:
        """The model's rollout buffer."""
        assert isinstance(self.model.rollout_buffer, DecisionBuffer)
        return self.model.rollout_buffer

    def summary(self) -> dict[str, Any]:
        """How far the run is, and how it was started, as JSON holds it."""
        return {
            "command": self.command,
            "args": self.options,
            "steps": self.model.num_timesteps,
            **self.progress.seconds,
            "validation": self.progress.curve[-1] if self.progress.curve else None,
        }


def save_policy(state: TrainingState) -> Checkpoint:
    """The policy alone."""
    stats = state.observation_stats.arrays("observations") | state.buffer.return_stats.arrays("returns")
    return Checkpoint(state.settings, state.summary(), weights_of(state.model.policy), stats)


def save_state(state: TrainingState) -> Checkpoint:
    """The policy and all that training needs to continue, between two rollouts."""
    checkpoint, model = save_policy(state), state.model
    optimiser = model.policy.optimizer.state_dict()["state"]
    tensors = {f"{i}.{name}": each for i, own in optimiser.items() for name, each in own.items()}
    arrays = {_ENVS + name: array for name, array in state.envs.arrays().items()}
    checkpoint.trainer = TrainerState(
        tensors | {_TORCH_RNG: torch.get_rng_state()},
        arrays
        | {
            "last_observations": np.asarray(model._last_obs),
            "episode_starts": np.asarray(model._last_episode_starts),
        },
        {name: getattr(state.progress, name) for name in _COUNTERS}
        | {_SHUFFLE_RNG: state.buffer.rng.bit_generator.state, "updates": model._n_updates},
    )
    return checkpoint


def restore_state(state: TrainingState, checkpoint: Checkpoint) -> None:
    """Put a run that was set up with the same options where the checkpoint's run was.

    Raises:
        CheckpointError: It does not fit this run.
    """
    if checkpoint.settings != state.settings:
        allowed = "the settings that the run was started with"
        raise CheckpointError("scenario", state.settings.scenario.name, allowed)
    load_weights(state.model.policy, checkpoint)
    try:
        _restore_trainer(state, checkpoint)
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise CheckpointError("checkpoint", repr(error), "one of this version of training.ppo") from None


def _restore_trainer(state: TrainingState, checkpoint: Checkpoint) -> None:
    """Everything but the policy's weights."""
    model, buffer, trainer = state.model, state.buffer, checkpoint.trainer
    if trainer is None:
        raise LookupError("no trainer's state")
    optimiser: dict[int, dict[str, torch.Tensor]] = {}
    for name, tensor in trainer.tensors.items():
        if name != _TORCH_RNG:
            place, _, part = name.partition(".")
            optimiser.setdefault(int(place), {})[part] = tensor
    model.policy.optimizer.load_state_dict(model.policy.optimizer.state_dict() | {"state": optimiser})
    state.envs.reset()
    arrays = trainer.arrays
    state.envs.set_arrays(
        {name.removeprefix(_ENVS): array for name, array in arrays.items() if name.startswith(_ENVS)}
    )
    model._last_obs = arrays["last_observations"]
    model._last_episode_starts = arrays["episode_starts"]
    model.num_timesteps, model._n_updates = checkpoint.progress["steps"], trainer.counters["updates"]
    state.observation_stats.load_arrays("observations", checkpoint.normalisation)
    buffer.return_stats.load_arrays("returns", checkpoint.normalisation)
    buffer.rng.bit_generator.state = trainer.counters[_SHUFFLE_RNG]
    for name in _COUNTERS:
        setattr(state.progress, name, trainer.counters[name])
    state.progress.seconds = {part: checkpoint.progress[part] for part in state.progress.seconds}
    torch.set_rng_state(trainer.tensors[_TORCH_RNG])


def checkpoint_to_resume(folder: Path) -> Checkpoint | None:
    """The latest checkpoint of a run; None where it has none yet, so that it begins again.

    Raises:
        CheckpointError: It is broken.
    """
    try:
        latest = latest_checkpoint(folder, "step")
    except CheckpointError:
        forget_later(folder, "best", 0)
        return None
    return load_checkpoint(latest, training=True)


def start_from(state: TrainingState, folder: Path) -> None:
    """Begin a new run with the weights of another, and with the scale of what its critic learned.

    Args:
        state: Of the new run.
        folder: A run or a checkpoint.

    Raises:
        CheckpointError: It cannot be read, or its networks are others.
    """
    checkpoint = load_checkpoint(latest_checkpoint(folder, *POLICIES))
    check_same_networks(folder, checkpoint.settings, state.settings)
    load_weights(state.model.policy, checkpoint)
    state.buffer.return_stats.load_arrays("returns", checkpoint.normalisation)


def check_unused(folder: Path) -> None:
    """Raise a SettingError if there is a run in a folder that is to be a new run's."""
    used = any(path for pattern in (FILE, "step-*", "best-*", "curve.csv") for path in folder.glob(pattern))
    check_new(folder, used)
