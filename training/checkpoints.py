"""Checkpoints: a policy, and what its trainer needs to continue, in files that hold no code.

A checkpoint is a folder, which is written whole or not at all:

    policy.json            the PolicySettings, how far training was, and each file's SHA-256
    policy.safetensors     weights of the networks
    normalisation.npz      means and variances of observations and returns
    training.safetensors   of the trainer: the optimiser's state, PyTorch's random state
    training.npz           of the trainer: the missions that are under way
    training.json          of the trainer: counters, the curve, the best validation, a random state

Checkpoints of the policy alone lack the last three. Nothing is ever unpickled.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.torch import load as tensors_of
from safetensors.torch import save as bytes_of

from entropy_explore_env.errors import EntropyExploreError, SettingError, one_of
from entropy_explore_env.missions.observation.layout import ObservationLayout
from entropy_explore_env.planner.candidate_features import COLUMNS, CONTEXT_COLUMNS, FEATURES_VERSION
from entropy_explore_env.settings.json import scenario_of, settings_of
from entropy_explore_env.settings.scenario import Scenario
from training.candidate_network import ATTENTION_LAYERS, check_attention_layers
from training.networks import NETWORKS


class CheckpointError(SettingError):
    """A checkpoint cannot be used: missing, broken, foreign, or of a policy for something else."""


class NotFiniteError(EntropyExploreError):
    """Training met a number that is not finite."""

    def __init__(self, tensor: str, value: object, steps: int) -> None:
        """Name the tensor, show the number and the steps at which it came up."""
        super().__init__(f"{tensor} = {value} after {steps:,} steps: allowed are finite numbers")
        self.tensor, self.value, self.steps = tensor, value, steps


class SilentRunnersError(EntropyExploreError):
    """No runner has reported for so long that a run cannot go on."""

    def __init__(self, runners: int, seconds: float, decisions: int) -> None:
        """Say how many there are, how long they were waited for, and how far the run had come."""
        super().__init__(
            f"none of {runners} runners reported within {seconds:,.0f} s, after {decisions:,} decisions: "
            "--resume goes on from the last checkpoint"
        )
        self.runners, self.seconds, self.decisions = runners, seconds, decisions


def stored_bytes(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Return an archive of arrays, not compressed."""
    file = io.BytesIO()
    np.savez(file, **arrays)  # pyright: ignore[reportArgumentType] - names are those of arrays
    return file.getvalue()


def stored_arrays(content: bytes) -> dict[str, np.ndarray]:
    """Return the arrays of an archive that `stored_bytes` made.

    Raises:
        ValueError: Its arrays are compressed. A broken archive raises whatever zipfile and NumPy raise.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as members:
        if any(each.file_size != each.compress_size for each in members.infolist()):
            raise ValueError("its arrays are compressed: a small file could fill the memory")
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


FORMAT = 1
_MOST_WEIGHTS = 1 << 26
_MOST_PRIVILEGED = 1024
_CANDIDATE_FEATURES = [*COLUMNS, *(f"context: {name}" for name in CONTEXT_COLUMNS)]
"""Names of what policies over candidates read: of each candidate, and of the robot's situation."""
_KEPT = 2
"""How many of a run's latest checkpoints of a kind stay, in case the newest one turns out unreadable."""


@dataclass(frozen=True)
class PolicySettings:
    """What determines a policy's networks.

    Attributes:
        scenario: The scenario of training; its observations and actions are the policy's.
        features: The networks that read observations: a name of NETWORKS.
        hidden: Units of each hidden layer of actor and critic; over candidates one number, the units of each.
        privileged: Numbers that follow an observation in training, which only the critic reads.
        features_version: Of the features of candidates, `FEATURES_VERSION`; None = it does not observe them.
        attention_layers: Of the actor over candidates.
    """

    scenario: Scenario
    features: str = "vector"
    hidden: tuple[int, ...] = (128, 128)
    privileged: int = 0
    features_version: int | None = None
    attention_layers: int = ATTENTION_LAYERS


@dataclass(frozen=True)
class TrainerState:
    """What only the trainer needs.

    Attributes:
        tensors: The optimiser's and PyTorch's random state.
        arrays: The missions that are under way.
        counters: Whatever else JSON holds.
    """

    tensors: dict[str, torch.Tensor]
    arrays: dict[str, np.ndarray]
    counters: dict[str, Any]


@dataclass
class Checkpoint:
    """What a checkpoint holds.

    Attributes:
        settings: Of the policy.
        progress: How far training is: steps, seconds, the command, the latest validation.
        weights: Of the networks.
        normalisation: Arrays of the Normalisers.
        trainer: What continuing needs; None in a checkpoint of the policy alone.
    """

    settings: PolicySettings
    progress: dict[str, Any]
    weights: dict[str, torch.Tensor]
    normalisation: dict[str, np.ndarray]
    trainer: TrainerState | None = None


def save_checkpoint(folder: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint, and remove all but the latest two of its kind.

    Args:
        folder: `…/KIND-STEPS`; replaced if it exists.
        checkpoint: What to write.
    """
    files = {
        "policy.safetensors": bytes_of(checkpoint.weights),
        "normalisation.npz": stored_bytes(checkpoint.normalisation),
    }
    if checkpoint.trainer is not None:
        files["training.safetensors"] = bytes_of(checkpoint.trainer.tensors)
        files["training.npz"] = stored_bytes(checkpoint.trainer.arrays)
        files["training.json"] = _json(checkpoint.trainer.counters)
    over_candidates = checkpoint.settings.features == "candidates"
    files["policy.json"] = _json(
        {
            "format": FORMAT,
            "features": checkpoint.settings.features,
            "hidden": list(checkpoint.settings.hidden),
            "privileged": checkpoint.settings.privileged,
            "features_version": checkpoint.settings.features_version,
            "candidate_features": _CANDIDATE_FEATURES if over_candidates else None,
            "observation": _observation_of(checkpoint.settings.scenario),
            "attention_layers": checkpoint.settings.attention_layers,
            "progress": checkpoint.progress,
            "sha256": {name: hashlib.sha256(content).hexdigest() for name, content in files.items()},
            "scenario": settings_of(checkpoint.settings.scenario),
        }
    )
    _write_folder(folder, files)
    kind = folder.name.rpartition("-")[0]
    for old in _numbered(folder.parent, kind)[:-_KEPT]:
        shutil.rmtree(old)


def _write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write a folder of files, whole or not at all."""
    unfinished = folder.with_name(f".{folder.name}.unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    try:
        unfinished.mkdir(parents=True)
        for name, content in files.items():
            with (unfinished / name).open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
        if folder.exists():
            shutil.rmtree(folder)
        unfinished.rename(folder)
    except BaseException:
        shutil.rmtree(unfinished, ignore_errors=True)
        raise


def checkpoint_name(kind: str, steps: int) -> str:
    """Return the name of a checkpoint's folder; names of one kind sort by steps."""
    return f"{kind}-{steps:012d}"


def _numbered(folder: Path, kind: str) -> list[Path]:
    """Return the checkpoints of a kind, oldest first."""
    return sorted(path for path in folder.glob(f"{kind}-*") if path.name.rpartition("-")[2].isdecimal())


def forget_later(folder: Path, kind: str, steps: int) -> None:
    """Remove checkpoints of a kind with more steps: a run that is resumed from there writes its own."""
    for later in _numbered(folder, kind):
        if int(later.name.rpartition("-")[2]) > steps:
            shutil.rmtree(later)


def latest_checkpoint(folder: Path, *kinds: str) -> Path:
    """Return the folder itself if it is a checkpoint, else its latest one of the first kind that it has.

    Raises:
        CheckpointError: There is none.
    """
    if (folder / "policy.json").is_file():
        return folder
    for kind in kinds:
        if there := _numbered(folder, kind):
            return there[-1]
    raise CheckpointError("checkpoint", str(folder), "a folder that training.ppo wrote")


def load_checkpoint(folder: Path, training: bool = False) -> Checkpoint:
    """Read a checkpoint.

    Args:
        folder: Of the checkpoint itself.
        training: Whether to read the trainer's state, too.

    Raises:
        CheckpointError: It is missing, broken, foreign or of another format.
    """
    try:
        head = json.loads((folder / "policy.json").read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        raise CheckpointError("checkpoint", str(folder), "a folder with a readable policy.json") from None
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        given = head.get("format") if isinstance(head, dict) else head
        raise CheckpointError(f"{folder / 'policy.json'}: format", given, f"{FORMAT}")
    settings = _settings(folder, head)
    digests = head.get("sha256")
    if not isinstance(digests, dict) or not isinstance(head.get("progress"), dict):
        raise CheckpointError(str(folder / "policy.json"), sorted(head), "a file with progress and sha256")
    loaded = Checkpoint(
        settings,
        head["progress"],
        _tensors(folder / "policy.safetensors", digests),
        _arrays(folder / "normalisation.npz", digests),
    )
    if training:
        loaded.trainer = TrainerState(
            _tensors(folder / "training.safetensors", digests),
            _arrays(folder / "training.npz", digests),
            _counters(folder / "training.json", digests),
        )
    return loaded


def _settings(folder: Path, head: Mapping[str, Any]) -> PolicySettings:
    """Return the PolicySettings that a head describes."""
    features, hidden = head.get("features"), head.get("hidden")
    if not isinstance(features, str) or features not in NETWORKS:
        raise CheckpointError(f"{folder}: features", features, one_of(features, NETWORKS))
    if not isinstance(hidden, list) or not all(type(units) is int and 0 < units <= 65536 for units in hidden):
        raise CheckpointError(f"{folder}: hidden", hidden, "a list of whole numbers from 1 to 65536")
    if sum(one * other for one, other in pairwise(hidden)) > _MOST_WEIGHTS:
        raise CheckpointError(
            f"{folder}: hidden", hidden, f"layers with at most {_MOST_WEIGHTS} weights between"
        )
    privileged = head.get("privileged", 0)
    if type(privileged) is not int or not 0 <= privileged <= _MOST_PRIVILEGED:
        raise CheckpointError(f"{folder}: privileged", privileged, f"from 0 to {_MOST_PRIVILEGED}")
    check_features_version(folder, head)
    layers = head.get("attention_layers", ATTENTION_LAYERS)
    try:
        check_attention_layers(layers)
    except SettingError as error:
        raise CheckpointError(f"{folder}: attention_layers", layers, error.allowed) from None
    try:
        scenario = scenario_of(head.get("scenario", {}))
    except EntropyExploreError as error:
        raise CheckpointError(f"{folder}: scenario", str(error), "settings of this version") from None
    _check_observation(folder, head.get("observation"), scenario)
    version = head.get("features_version")
    return PolicySettings(scenario, features, tuple(hidden), privileged, version, layers)


def check_features_version(folder: Path, head: Mapping[str, Any]) -> None:
    """Check that a policy over candidates was trained on the features that this library computes.

    Args:
        folder: Of the checkpoint.
        head: What its policy.json holds.

    Raises:
        CheckpointError: Version or names of its features are others.
    """
    version = head.get("features_version")
    current = FEATURES_VERSION if head.get("features") == "candidates" else None
    if version != current or isinstance(version, bool):
        allowed = f"{current}: its features of candidates are not those of this library"
        raise CheckpointError(f"{folder}: features_version", version, allowed)
    names = head.get("candidate_features")
    if current is None or names is None or names == _CANDIDATE_FEATURES:
        return
    theirs = names if isinstance(names, list) else []
    strange = [name for name in theirs if name not in _CANDIDATE_FEATURES]
    missing = [name for name in _CANDIDATE_FEATURES if name not in theirs]
    differing = next(iter((*strange, *missing)), "their order")
    allowed = "the features of candidates of this library, in their order"
    raise CheckpointError(f"{folder}: candidate_features", differing, allowed)


def _check_observation(folder: Path, observation: object, scenario: Scenario) -> None:
    """Check that an observation has the parts and shapes that a policy was trained on.

    Raises:
        CheckpointError: One of them is another one.
    """
    if observation is None:  # of a checkpoint from before they were noted
        return
    ours, theirs = _observation_of(scenario), observation if isinstance(observation, dict) else {}
    for name in (*ours, *theirs):
        if ours.get(name) != theirs.get(name):
            allowed = f"{ours.get(name)}, as this library observes in its scenario"
            raise CheckpointError(f"{folder}: observation {name}", theirs.get(name), allowed)


def _observation_of(scenario: Scenario) -> dict[str, list[int]]:
    """Return the name and shape of each part of an observation."""
    return {name: list(part.shape) for name, part in ObservationLayout(scenario).parts.items()}


def _content(file: Path, digests: Mapping[str, Any]) -> bytes:
    """Return a file's content, if it is what save_checkpoint wrote."""
    try:
        content = file.read_bytes()
    except OSError as error:
        raise CheckpointError(
            "checkpoint", str(file), f"a file that can be read ({error.strerror})"
        ) from None
    if hashlib.sha256(content).hexdigest() != digests.get(file.name):
        raise CheckpointError("checkpoint", str(file), "the file as it was written, whole and unchanged")
    return content


def _tensors(file: Path, digests: Mapping[str, Any]) -> dict[str, torch.Tensor]:
    try:
        return tensors_of(_content(file, digests))
    except SafetensorError as error:
        said = " ".join(str(error).split())[:200]
        raise CheckpointError("checkpoint", str(file), f"safetensors ({said})") from None


def _counters(file: Path, digests: Mapping[str, Any]) -> dict[str, Any]:
    content = _content(file, digests)
    try:
        counters = json.loads(content)
    except (ValueError, RecursionError):
        counters = None
    if not isinstance(counters, dict):
        raise CheckpointError("checkpoint", str(file), "JSON with an object")
    return counters


def _arrays(file: Path, digests: Mapping[str, Any]) -> dict[str, np.ndarray]:
    try:
        return stored_arrays(_content(file, digests))
    except CheckpointError:
        raise
    except Exception as error:  # of a broken archive: zipfile and NumPy raise a dozen kinds
        said = " ".join(str(error).split())[:200]
        raise CheckpointError("checkpoint", str(file), f"NumPy's npz without objects ({said})") from None


def _json(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, indent=1, allow_nan=False).encode()
