"""A training run in its folder: its options, and its state, from which it is continued bit for bit."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeVar

import numpy as np
import torch
from stable_baselines3 import PPO

from baselines.cli.arguments import parse
from baselines.cli.options import Mark
from baselines.cli.task_options import TaskOptions
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.json import dataclass_of, settings_of
from entropy_explore_env.settings.validation import check_whole, is_whole
from entropy_explore_env.writing import write_atomically
from training.advantages import DecisionBuffer, DiscountUnit, Normaliser
from training.checkpoints import (
    Checkpoint,
    CheckpointError,
    NotFiniteError,
    PolicySettings,
    TrainerState,
    forget_later,
    latest_checkpoint,
    load_checkpoint,
)
from training.policy import POLICIES, check_same_networks, load_weights, weights_of
from training.progress import Progress


@dataclass
class LearningOptions:
    """Options of every trainer of policies."""

    scenario: str = "room"
    """Named scenario: room, room-furnished, office, … (docs/environments.md lists them)."""
    robots: int = 3
    """Robots in a team."""
    seed: int = 0
    """Seed of weights, missions and all other draws."""
    resume: Path | None = None
    """Folder of a run to continue from its latest checkpoint, with the settings that it was started with."""
    task: Annotated[TaskOptions, Mark.INLINE] = field(default_factory=TaskOptions)
    cost_per_s: float | None = None
    """Cost of a second, as a share of all bits that the mission has to gain; default: the scenario's."""
    hidden: tuple[int, ...] = (128, 128)
    """Units of the hidden layers of actor and critic."""
    yaws: int = 16
    """Gazes, and rays of the panorama, around the horizon."""
    pitches: int = 7
    """Gazes, and rays of the panorama, from -45° to 45°."""
    learning_rate: float = 1e-3
    """Adam's learning rate at first; it falls linearly to a twentieth."""
    discount: DiscountUnit = "seconds"
    """What the discount is counted in: seconds or decisions."""
    gamma: float = 0.9
    """Discount factor per second, or per decision."""
    gae_lambda: float = 0.95
    """λ of generalised advantage estimation, per decision."""
    clip: float = 0.2
    """Clipping range of PPO's probability ratio."""
    entropy: float = 0.003
    """Weight of the entropy bonus."""
    epochs: int = 4
    """Passes over the decisions of a rollout, or an iteration, in an update."""
    validation_missions: int = 32
    """Missions in a validation."""


_POSITIVE = (
    "total_steps", "missions", "batch", "epochs", "checkpoint_every", "validate_every", "validation_missions",
)  # fmt: skip


def check_options(args: Any) -> None:  # noqa: ANN401 - LearningOptions, and what both trainers add to them
    """Raise a SettingError where an option that every trainer has is out of its range."""
    for name in _POSITIVE:
        check_whole(name, getattr(args, name), 1)
    check_whole("seed", args.seed, 0)
    for name in ("gamma", "gae_lambda"):
        if not 0.0 < getattr(args, name) <= 1.0:
            raise SettingError(name, getattr(args, name), "a number above 0, at most 1")
    if not 0.0 <= args.entropy < math.inf:
        raise SettingError("entropy", args.entropy, "a number ≥ 0")
    for name in ("learning_rate", "clip"):
        if not 0.0 < getattr(args, name) < math.inf:
            raise SettingError(name, getattr(args, name), "a number above 0")
    if not args.hidden or not all(is_whole(units, 1) for units in args.hidden):
        raise SettingError("hidden", args.hidden, "whole numbers ≥ 1")


def check_new(out: Path, used: bool) -> None:
    """Raise a SettingError if there is a run in the folder of a new one already."""
    if used:
        raise SettingError("out", str(out), f"a new folder; --resume {out} continues the run in it")


FILE = "run.json"
OF_THE_CALL = frozenset(("out", "resume"))
"""Options that say where a run is, and that are no settings of it."""
_INLINE = frozenset(("task", "world_file"))
"""Options in options whose own name is not typed."""


class RunOptions(Protocol):
    """Options of every trainer that has runs in folders; a dataclass."""

    out: Path | None
    resume: Path | None


Options = TypeVar("Options", bound=RunOptions)


def options_json(args: Any) -> dict[str, Any]:  # noqa: ANN401 - a dataclass of options
    """Return the options of a command as JSON holds them, without those that say where the run is."""
    fields = {each.name: getattr(args, each.name) for each in dataclasses.fields(args)}
    return {
        name: str(value) if isinstance(value, Path) else settings_of(value)
        for name, value in fields.items()
        if name not in OF_THE_CALL
    }


def save_options(folder: Path, args: RunOptions, module: str, words: Sequence[str]) -> None:
    """Note in a run's folder what it is started with, and what its world files hold.

    Raises:
        SettingError: The folder cannot be written.
    """
    started = {
        "command": shlex.join(["python", "-m", module, *words]),
        "args": options_json(args),
        "files": {str(file): _digest(file) for file in _files_of(args)},
    }
    try:
        write_atomically(folder / FILE, json.dumps(started, indent=1, allow_nan=False) + "\n")
    except OSError as error:
        raise SettingError("out", str(folder), f"a folder that can be written ({error.strerror})") from None


def _files_of(args: RunOptions) -> list[Path]:
    """Return the world files that options name."""
    task = getattr(args, "task", None)
    named = (*(task.world if task is not None else ()), *getattr(args, "validation_world", ()))
    return [Path(file) for file in named if Path(file).is_file()]


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _check_files(folder: Path, files: Mapping[str, str]) -> None:
    """Raise a CheckpointError where a world file of a run is not what it was."""
    for file, digest in files.items():
        there = Path(file).is_file()
        if not there or _digest(Path(file)) != digest:
            state = "changed since" if there else "missing"
            raise CheckpointError("world", file, f"the file that the run in {folder} began with ({state})")


def resumed_options(
    kind: type[Options],
    folder: Path,
    words: Sequence[str],
    changeable: frozenset[str],
    description: str | None = None,
    settle: Callable[[Options], Options] = lambda options: options,
) -> tuple[Options, dict[str, Any]]:
    """Return the options of a run that is continued: those that it was started with, and what may differ.

    Args:
        kind: The dataclass of options.
        folder: Of the run.
        words: Of the command line that continues it.
        changeable: Options that may differ.
        description: The first line of the help.
        settle: Makes options the same wherever they are read, as those that the run was started with.

    Returns:
        The options, and the values before of those that were changed.

    Raises:
        CheckpointError: There is no run in the folder, another option differs, or a world file has changed.
        SettingError: `--out` names another folder.
    """
    try:
        run = json.loads((folder / FILE).read_text("utf-8"))
        started, files = dataclass_of(kind, run["args"], FILE), dict(run["files"])
    except FileNotFoundError:
        raise CheckpointError("resume", str(folder), f"the folder of a run; it has no {FILE}") from None
    except (OSError, ValueError, LookupError, TypeError) as error:
        reason = f": {error}" if isinstance(error, SettingError) else ""
        allowed = f"the folder of a run, with a {FILE} of this version{reason}"
        raise CheckpointError("resume", str(folder), allowed) from None
    _check_files(folder, files)
    started.out = started.resume = folder
    args = parse(kind, words, default=started, description=description)
    if args.out is not None and args.out.absolute() != folder.absolute():
        raise SettingError("out", str(args.out), "no value beside --resume, which names the folder")
    args = settle(args)
    args.out, changed = folder, {}
    was, now = _flat(options_json(started)), _flat(options_json(args))
    for name in was.keys() | now.keys():
        if was.get(name) != now.get(name):
            if name not in changeable:
                raise CheckpointError(name, now.get(name), f"{was.get(name)}, as in the run in {folder}")
            changed[name] = was.get(name)
    return args, changed


def told(changed: Mapping[str, object]) -> str:
    """Return the end of a message about options that differ from those that a run was started with."""
    return "".join(f"; {name} was {value}" for name, value in changed.items())


def _flat(options: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested options by their names on the command line, such as `channel.burst`."""
    flat: dict[str, Any] = {}
    for name, value in options.items():
        inside = prefix if name in _INLINE else f"{prefix}{name}."
        flat |= _flat(value, inside) if isinstance(value, dict) else {prefix + name: value}
    return flat


def resume_command(module: str, folder: Path) -> str:
    """Return what one types to continue a run."""
    return shlex.join(["python", "-m", module, "--resume", str(folder)])


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
        """Return how far the run is, and how it was started, as JSON holds it."""
        return {
            "command": self.command,
            "args": self.options,
            "steps": self.model.num_timesteps,
            **self.progress.seconds,
            "validation": self.progress.curve[-1] if self.progress.curve else None,
        }


def save_policy(state: TrainingState) -> Checkpoint:
    """Return the policy alone."""
    stats = state.observation_stats.arrays("observations") | state.buffer.return_stats.arrays("returns")
    return Checkpoint(state.settings, state.summary(), weights_of(state.model.policy), stats)


def save_state(state: TrainingState) -> Checkpoint:
    """Return the policy and all that training needs to continue, between two rollouts."""
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
    """Restore everything but the policy's weights."""
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
    """Return the latest checkpoint of a run; None where it has none yet, so that it begins again.

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


def check_finite(model: PPO) -> None:
    """Raise a NotFiniteError if the latest loss or any weight is not finite."""
    for name, value in model.logger.name_to_value.items():
        if name.startswith("train/") and name.endswith("loss") and not np.isfinite(value):
            raise NotFiniteError(name, value, model.num_timesteps)
    for name, weights in weights_of(model.policy).items():
        if not torch.isfinite(weights).all():
            value = float(weights[~torch.isfinite(weights)][0])
            raise NotFiniteError(name, value, model.num_timesteps)
