"""Labels of roll-outs as files: a shard holds those of some missions, and is written whole or not at all.

A shard is an npz of the arrays of `Labels`, and of a text of JSON: the version of the format, digests of the
code and of the settings that it was made with, and the seeds of its missions. Nothing is ever unpickled.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.writing import write_atomically
from training.errors import LabelsError
from training.policy_improvement.origin import Origin
from training.stored_arrays import stored_arrays, stored_bytes

FORMAT = 2
_HEAD = "head"


class Labels(NamedTuple):
    """What the roll-outs of N states came to, and the moments (T) of the missions that they come from."""

    observations: np.ndarray
    """(N, size + P) float32, what the deciding robot observed, and what only training knows."""
    candidates: np.ndarray
    """(N, B) int64, numbers of the candidates that were tried; the planner's choice first, -1 = none."""
    seconds: np.ndarray
    """(N, B, D) float32 until the branch's end or horizon; NaN = none."""
    ended: np.ndarray
    """(N, B, D) bool, whether the mission ended there."""
    at_end: np.ndarray
    """(N, B, D, P) float32, privileged numbers there."""
    to_go_s: np.ndarray
    """(N,) float32, seconds that the mission itself still took."""
    mission: np.ndarray
    """(N,) int64, number of the mission, over all shards."""
    task: np.ndarray
    """(N,) int64, number of the task that the mission is of."""
    moments: np.ndarray
    """(T, P) float32, privileged numbers along the missions."""
    moments_to_go_s: np.ndarray
    """(T,) float32, seconds that the mission still took."""
    moments_mission: np.ndarray
    """(T,) int64, number of the mission."""
    moments_task: np.ndarray
    """(T,) int64, number of its task."""

    @classmethod
    def joined(cls, parts: list[Labels]) -> Labels:
        """All labels of several shards."""
        return cls(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


_KINDS = {
    "observations": np.float32,
    "candidates": np.int64,
    "seconds": np.float32,
    "ended": np.bool_,
    "at_end": np.float32,
    "to_go_s": np.float32,
    "mission": np.int64,
    "task": np.int64,
    "moments": np.float32,
    "moments_to_go_s": np.float32,
    "moments_mission": np.int64,
    "moments_task": np.int64,
}


def shard_file(folder: Path, number: int) -> Path:
    """Where a shard lies."""
    return folder / f"labels-{number:05d}.npz"


def save_shard(file: Path, labels: Labels, origin: Origin, seeds: list[int]) -> None:
    """Write a shard, whole or not at all."""
    head = {"format": FORMAT, **origin._asdict(), "seeds": [str(seed) for seed in seeds]}
    text = np.frombuffer(json.dumps(head).encode(), np.uint8)
    write_atomically(file, stored_bytes({**labels._asdict(), _HEAD: text}))


def load_shard(file: Path, origin: Origin) -> Labels:
    """Read a shard.

    Raises:
        LabelsError: It is broken, or of another version of the code, or made with other settings.
    """
    arrays = _arrays(file)
    head = _head_of(file, arrays)
    if head.get("format") != FORMAT:
        raise LabelsError(f"{file}: format", head.get("format"), f"{FORMAT}")
    origin.check(file, head)
    for name, kind in _KINDS.items():
        if name not in arrays or arrays[name].dtype != kind:
            found = None if name not in arrays else str(arrays[name].dtype)
            raise LabelsError(f"{file}: {name}", found, f"an array of {np.dtype(kind)}")
    labels = Labels(**{name: arrays[name] for name in _KINDS})
    _check_shapes(file, labels)
    return labels


def _check_shapes(file: Path, labels: Labels) -> None:
    """Raise a LabelsError where arrays do not fit each other, or numbers are not what they should be."""
    states, moments = len(labels.observations), len(labels.moments)
    tried = labels.candidates.shape
    shapes = {
        "candidates": (states, *tried[1:]),
        "seconds": (*tried, *labels.seconds.shape[2:]),
        "ended": labels.seconds.shape,
        "at_end": (*labels.seconds.shape, *labels.at_end.shape[3:]),
        "to_go_s": (states,),
        "mission": (states,),
        "task": (states,),
        "moments_to_go_s": (moments,),
        "moments_mission": (moments,),
        "moments_task": (moments,),
    }
    for name, shape in shapes.items():
        given = getattr(labels, name)
        if given.shape != shape:
            raise LabelsError(f"{file}: {name}", given.shape, f"{shape}")
    there = np.broadcast_to(labels.candidates[:, :, None] >= 0, labels.seconds.shape)
    numbers = (labels.observations, labels.seconds[there], labels.at_end, labels.to_go_s, labels.moments)
    if not all(np.isfinite(each).all() for each in numbers) or (labels.seconds[there] < 0.0).any():
        raise LabelsError(f"{file}: seconds", "not finite, or below 0", "finite numbers")


def _arrays(file: Path) -> dict[str, np.ndarray]:
    try:
        return stored_arrays(file.read_bytes())
    except Exception as error:  # of a broken archive: zipfile and NumPy raise a dozen kinds
        said = " ".join(str(error).split())[:200]
        raise LabelsError("labels", str(file), f"a shard as it was written, whole ({said})") from None


def _head_of(file: Path, arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    try:
        head = json.loads(arrays[_HEAD].tobytes())
    except (LookupError, ValueError, RecursionError):
        head = None
    if not isinstance(head, dict):
        raise LabelsError(f"{file}: {_HEAD}", None, "JSON with an object")
    return head
