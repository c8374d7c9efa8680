"""Files that the library saves itself, changed: records of missions, and checkpoints of policies.

Both hold digests of their content. Half of the changes are followed by right digests, so that they reach the
code that reads the content.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from baselines.experiments.mission import run_mission
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.mission_record import (
    CommandRecorder,
    given_worlds_of,
    load_record,
    reset_options_of,
    save_record,
)
from entropy_explore_env.reports.state_digest import named_digest
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX

Change = Callable[[bytes, np.random.Generator], bytes]
_VALUES: tuple[Any, ...] = (None, True, -1, 0, 1e308, 2**40, 2**70, "x", "", [], {}, [[]], float("nan"))


class Saved(NamedTuple):
    """What the library saved in a folder.

    Attributes:
        files: Name → sound content.
        load: Reads those beside the first, from the path of that.
        repair: Makes the digests right again, where that is possible.
    """

    files: dict[str, bytes]
    load: Callable[[Path], object]
    repair: Callable[[dict[str, bytes]], dict[str, bytes]]

    def changed(self, number: int, rng: np.random.Generator) -> tuple[str, dict[str, bytes]]:
        """Return what was changed, and the files with it; half of them have right digests."""
        del number
        name = list(self.files)[int(rng.integers(len(self.files)))]
        change = CHANGES[int(rng.integers(len(CHANGES)))]
        files = {**self.files, name: change(self.files[name], rng)}
        return f"{change.__name__} of {name}", self.repair(files) if rng.random() < 0.5 else files


def truncated(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut off the end."""
    return data[: int(rng.integers(0, len(data)))]


def flipped(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip one to eight bits."""
    changed = bytearray(data or b"0")
    for _ in range(int(rng.integers(1, 9))):
        changed[int(rng.integers(len(changed)))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def overwritten(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace some bytes by noise."""
    start, length = int(rng.integers(len(data))), int(rng.integers(1, 65))
    return data[:start] + rng.bytes(length) + data[start + length :]


def doubled(data: bytes, rng: np.random.Generator) -> bytes:
    """Repeat a piece a few hundred times."""
    start = int(rng.integers(len(data)))
    piece = data[start : start + int(rng.integers(1, 200))]
    return data[:start] + piece * int(rng.integers(2, 400)) + data[start:]


def another_value(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace one value of JSON by one of another kind or size."""
    try:
        content = json.loads(data)
    except ValueError:
        content = None
    if not isinstance(content, dict | list):
        return flipped(data, rng)
    holder: Any = content
    while True:
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        if not len(keys):
            return json.dumps([]).encode()
        key = keys[int(rng.integers(len(keys)))]
        if not isinstance(holder[key], dict | list) or not holder[key] or rng.random() < 0.2:
            holder[key] = _VALUES[int(rng.integers(len(_VALUES)))]
            return json.dumps(content).encode()
        holder = holder[key]


def another_array(data: bytes, rng: np.random.Generator) -> bytes:
    """Remove one array of an archive, or change its shape, type or numbers."""
    try:
        with np.load(io.BytesIO(data)) as archive:
            arrays = dict(archive)
    except Exception:  # no archive
        return another_value(data, rng)
    name = list(arrays)[int(rng.integers(len(arrays)))]
    array, which = arrays[name], int(rng.integers(6))
    if which == 0:
        del arrays[name]
    elif which == 1:
        arrays[name] = array[..., None]
    elif which == 2:
        arrays[name] = np.zeros(array.shape, ("f4", "i1", "U3", "c16", "?", "f8")[int(rng.integers(6))])
    elif which == 3:
        arrays[name] = np.resize(array, int(rng.integers(0, 50)))
    elif which == 4:
        arrays[f"{name}_"] = array
    elif array.dtype.kind == "U":
        text = another_value(str(array).encode(), rng).decode("utf-8", "replace")
        arrays[name] = np.asarray(text)
    else:
        arrays[name] = _other_numbers(array, rng)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _other_numbers(array: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return an array of its shape and type, with bytes of another number throughout."""
    number = (0.0, -1.0, 2.0**31, np.inf, np.nan)[int(rng.integers(5))]
    filled = np.full(array.size * array.itemsize // 8 + 1, number).tobytes()
    return np.frombuffer(filled[: array.size * array.itemsize], array.dtype).reshape(array.shape)


CHANGES: tuple[Change, ...] = (
    truncated,
    flipped,
    overwritten,
    doubled,
    another_value,
    another_array,
    another_array,
)


def record_files(folder: Path) -> Saved:
    """Return the record of a short mission, with starts that were given."""
    env = EntropyExploreEnv(with_settings(BOX, {"channel": {"delay_s": 1.0}, "max_cycles": 3}))
    env.reset(seed=5)
    starts, recorder = env.missions.state.robots[0]["origin"].copy(), CommandRecorder(env.missions)
    watched = lambda _: recorder.note(), recorder.command
    run_mission(env, make_strategy("random"), 5, *watched, {"starts": starts})
    save_record(recorder.record("random"), folder / "mission.npz")
    return Saved({"mission.npz": (folder / "mission.npz").read_bytes()}, _play_record, _with_checksum)


def _play_record(path: Path) -> object:
    """Read a record, and start its mission."""
    record = load_record(path)
    env = EntropyExploreEnv(record.scenario, **given_worlds_of(record))
    env.reset(seed=record.seed, options=reset_options_of(record))
    return env


def _with_checksum(files: dict[str, bytes]) -> dict[str, bytes]:
    try:
        with np.load(io.BytesIO(files["mission.npz"])) as archive:
            arrays = {name: array for name, array in archive.items() if name != "checksum"}
        digest = named_digest({name: np.asarray(arrays[name]) for name in sorted(arrays)})
        buffer = io.BytesIO()
        np.savez(buffer, **arrays, checksum=np.asarray(digest))
    except Exception:  # nothing there to be digested
        return files
    return {"mission.npz": buffer.getvalue()}


def checkpoint_files(folder: Path) -> Saved:
    """Return a checkpoint of a small policy, with its trainer's state."""
    import torch

    from training.advantages import Normaliser
    from training.checkpoints import Checkpoint, PolicySettings, TrainerState, save_checkpoint
    from training.policy import make_policy, weights_of

    torch.set_num_threads(1)  # of small matrices: more threads wait for each other
    form = {"action": {"kind": "discrete", "moves": "axes"}, "observation": {"flat": True}}
    settings = PolicySettings(with_settings(BOX, form), "vector", (6, 5))
    stats = Normaliser(Missions(settings.scenario).layout.size)
    kept = Checkpoint(
        settings,
        {"steps": 12},
        weights_of(make_policy(settings)),
        stats.arrays("observations") | Normaliser().arrays("returns"),
        TrainerState({"a": torch.arange(3)}, {"x": np.zeros(2, [("p", "f8"), ("q", "?")])}, {"big": 2**127}),
    )
    save_checkpoint(folder / "best-000000000012", kept)
    files = {path.name: path.read_bytes() for path in sorted((folder / "best-000000000012").iterdir())}
    return Saved(files, _load_checkpoint, _with_digests)


def _load_checkpoint(path: Path) -> object:
    """Read a checkpoint, and make its policy."""
    from training.checkpoints import load_checkpoint
    from training.policy import load_policy

    return load_policy(load_checkpoint(path.parent, training=True))


def _with_digests(files: dict[str, bytes]) -> dict[str, bytes]:
    try:
        head = json.loads(files["policy.json"])
        for name in head["sha256"]:
            head["sha256"][name] = hashlib.sha256(files[name]).hexdigest()
    except Exception:  # the head itself is spoiled
        return files
    return {**files, "policy.json": json.dumps(head).encode()}


SAVED: dict[str, Callable[[Path], Saved]] = {"record": record_files, "checkpoint": checkpoint_files}
