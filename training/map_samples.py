"""Samples for a predictor of maps: what a robot has measured around it, and what is there, cut from missions.

Missions of today's strategies run in worlds of the splits train and validation; of the dungeons, those with
odd numbers, the highest ten of which validate. Team sizes vary, and in plans sensors, voxels and the size of
the workspace. From each mission some decisions are kept, drawn at random. A mission's samples are one file,
and missions whose file is there are not run again.
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch

from baselines.cli.interruption import Interruption
from baselines.experiments.mission import run_mission, scripted_env
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.worker_pool import Failure, run_each
from baselines.strategies import make_strategy
from baselines.suites.prediction import WITHOUT
from baselines.suites.public_worlds import in_world
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.prediction.crop import OUTSIDE, PLANS, SOLID, around, pool_crop
from entropy_explore_env.prediction.unet import Form
from entropy_explore_env.prediction.volumes import VOLUMES, VolumeWindow, pool_volume_crop
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.writing import write_atomically
from training.checkpoints import stored_arrays, stored_bytes

_Numbers = TypeVar("_Numbers", np.ndarray, torch.Tensor)

PLAN_RECIPES = ("office", "corridor", "cluttered", "hybrid", "dungeon")
VOLUME_RECIPES = ("cave", "office-3d")
RECIPES = PLAN_RECIPES + VOLUME_RECIPES
"""What worlds are sampled from."""
SPLITS = ("train", "validation")
STRATEGIES = (WITHOUT, "nearest-frontier", "distance-advantage", "per-time-visibility")
"""The planner predicts nothing here: no weights depend on earlier ones."""
_DUNGEONS = {"train": range(1, 81, 2), "validation": range(81, 101, 2)}
"""The dungeons of each split; those of even number are for tests."""
_VOXELS_M = (0.1, 0.1, 0.2, 0.25)
_SCALES = (1.0, 1.0, 1.4)
"""Edges of workspaces relative to those of the named scenario."""
_RANGES_M = (4.5, 8.0, 8.0)
_RAYS_APART_RAD = np.pi / 180
_TEAMS = (1, 1, 2, 3)
_TIME_LIMIT_S = 3600.0
STEPS = 252
"""Steps in which shares of voxels are kept."""


class Sampled(NamedTuple):
    """A mission to be sampled."""

    recipe: str
    split: str
    number: int  # of the mission within recipe and split
    snapshots: int
    seed: int  # of the run

    @property
    def name(self) -> str:
        """What its file is called."""
        return f"{self.split}-{self.recipe}-{self.number:04d}-seed-{self.seed}-{self.snapshots}"

    @property
    def drawn_from(self) -> list[int]:
        """What seeds its random numbers."""
        return [self.seed, SPLITS.index(self.split), RECIPES.index(self.recipe), self.number]


class Samples(NamedTuple):
    """N samples of crops of C × C cells."""

    cells: np.ndarray
    """(N, 2·L + 1, C, C) uint8, the channels of a crop of L layers in steps of 1/252."""
    truth: np.ndarray
    """(N, L, C, C) bool, which cells are solid; in a volume, in which cells the middle voxel is."""


def form_of(recipe: str) -> Form:
    """Return the form of a network that learns from a recipe."""
    return VOLUMES if recipe in VOLUME_RECIPES else PLANS


def sampled_missions(
    recipes: Sequence[str], split: str, missions: int, snapshots: int, seed: int
) -> list[Sampled]:
    """Return as many missions of a split in each recipe."""
    return [Sampled(name, split, n, snapshots, seed) for n in range(missions) for name in recipes]


def scenario_of(sampled: Sampled, rng: np.random.Generator) -> Scenario:
    """Return the scenario of a mission, drawn by its recipe."""
    changes: dict[str, Any] = {
        "robots": int(rng.choice(_TEAMS)),
        "split": sampled.split,
        "sensor": {"max_range_m": float(rng.choice(_RANGES_M)), "angular_step_rad": _RAYS_APART_RAD},
        "ending": {"time_limit_s": _TIME_LIMIT_S},
    }
    if rng.random() < 0.5:
        changes["robot"] = {"redecide": "on_scan"}
        changes["sensor"]["scan_every_m"] = 1.0
    if sampled.recipe in VOLUME_RECIPES:  # all recipes have the same draws
        alone = {name: changes[name] for name in ("robots", "split", "ending")}
        return with_settings(SCENARIOS[sampled.recipe], alone)
    voxel_size_m, scale = float(rng.choice(_VOXELS_M)), float(rng.choice(_SCALES))
    if sampled.recipe == "dungeon":
        number = int(rng.choice(_DUNGEONS[sampled.split]))
        changes["robot"] = {**changes.get("robot", {}), "body_radius_m": 0.0}
        return with_settings(in_world(SCENARIOS["office"], f"dungeon-{number}"), changes)
    named = SCENARIOS[sampled.recipe]
    x, y = (max(round(edge * scale / voxel_size_m), 8) for edge in named.grid.size_m[:2])
    changes["grid"] = {"shape": (x, y, 1), "voxel_size_m": voxel_size_m}
    return with_settings(named, changes)


def sample_mission(sampled: Sampled) -> bytes:
    """Run a mission and return its samples, compressed."""
    rng = np.random.default_rng(sampled.drawn_from)
    env = scripted_env(scenario_of(sampled, rng))
    strategy = make_strategy(STRATEGIES[int(rng.integers(len(STRATEGIES)))])
    crops: list[np.ndarray] = []
    truths: list[np.ndarray] = []

    def note(env: EntropyExploreEnv) -> None:
        deciding = env.deciding_agents() if env.agents else []
        if deciding:
            view = env.view(deciding[int(rng.integers(len(deciding)))])
            cells, truth = crop_and_truth(env, view)
            crops.append(np.rint(cells * STEPS).astype(np.uint8))
            truths.append(truth)

    run_mission(env, strategy, int(rng.integers(2**62)), after_step=note)
    env.close()
    kept = np.sort(rng.permutation(len(crops))[: sampled.snapshots])
    arrays = {
        "cells": np.stack([crops[n] for n in kept]),
        "truth": np.packbits(np.stack([truths[n] for n in kept]), axis=-1),
    }
    return zlib.compress(stored_bytes(arrays))


def crop_and_truth(env: EntropyExploreEnv, view: RobotView) -> tuple[np.ndarray, np.ndarray]:
    """Return the channels (2·L + 1, C, C) around a robot, and what is solid (L, C, C) in its true world."""
    world = env.missions.worlds[0]
    assert world is not None
    given = (view.scenario.sigma_prior, view.pose, view.kind.robot.body_radius_m)
    there = around(world.grid, view.mean, view.precision, *given)
    if not world.grid.flat:
        cells, window = pool_volume_crop(there)
        return cells, _solid_cells(world.occupied, world.grid.voxel_size_m, window)
    cells = pool_crop(there)[0]
    occupied, sure = world.occupied.astype(np.float32), np.full(world.grid.shape, 1e9, np.float32)
    truth = pool_crop(around(world.grid, occupied, sure, *given))[0]
    return cells, ((truth[SOLID] > 0.0) | (truth[OUTSIDE] > 0.0))[None]


def _solid_cells(occupied: np.ndarray, voxel_size_m: float, window: VolumeWindow) -> np.ndarray:
    """Return (L, C, C) bool, which cells of a crop have a solid voxel in the middle, or lie outside."""
    counts = (VOLUMES.cells, VOLUMES.cells, VOLUMES.layers)
    found, inside = [], []
    for first, count, voxels in zip(window, counts, occupied.shape, strict=True):
        middle_m = (first + np.arange(count) + 0.5) * VOLUMES.cell_m
        at = np.floor(middle_m / voxel_size_m).astype(np.int64)
        inside.append((at >= 0) & (at < voxels))
        found.append(np.clip(at, 0, voxels - 1))
    x, y, z = np.meshgrid(*inside, indexing="ij", sparse=True)
    return np.moveaxis(occupied[np.ix_(*found)] | ~(x & y & z), 2, 0)


def make_samples(
    missions: Sequence[Sampled], folder: Path, workers: int | RayCluster, interruption: Interruption
) -> Iterator[Sampled]:
    """Write the file of each mission that has none, and yield the mission; Ctrl-C ends it after one."""
    missing = [each for each in missions if not file_of(folder, each).is_file()]
    with closing(run_each(sample_mission, missing, workers)) as results:
        for sampled, result in results:
            if isinstance(result, Failure):
                result.throw()
            else:
                write_atomically(file_of(folder, sampled), result)
            yield sampled
            if interruption.asked:
                return


def file_of(folder: Path, sampled: Sampled) -> Path:
    """Return the file of a mission's samples."""
    return folder / f"{sampled.name}.samples"


def read_samples(folder: Path, missions: Iterable[Sampled]) -> tuple[Samples, np.ndarray]:
    """Return the samples of missions, and the number (N,) in RECIPES of where each comes from.

    Raises:
        SettingError: A file is not what `make_samples` wrote.
    """
    cells, truths, recipes = [], [], []
    for sampled in missions:
        file = file_of(folder, sampled)
        try:
            arrays = stored_arrays(zlib.decompress(file.read_bytes()))
            truth = np.unpackbits(arrays["truth"], axis=-1).astype(bool)
            form, count = form_of(sampled.recipe), len(truth)
            parts = (arrays["cells"], form.channels), (truth, form.layers)
            if any(part.shape != (count, planes, form.cells, form.cells) for part, planes in parts):
                raise ValueError(f"samples of another form in {file}")
        except (OSError, ValueError, KeyError, EOFError, zlib.error, io.UnsupportedOperation):
            allowed = "samples that this command wrote: remove that file, and it is made again"
            raise SettingError("out", str(file), allowed) from None
        cells.append(arrays["cells"])
        truths.append(truth)
        recipes += [RECIPES.index(sampled.recipe)] * len(truth)
    return Samples(np.concatenate(cells), np.concatenate(truths)), np.array(recipes)


def unmeasured(cells: _Numbers) -> _Numbers:
    """Return (N, L, C, C) bool, the cells of a workspace in which nothing was measured, from channels."""
    layers = cells.shape[1] // 2
    nothing = (cells[:, :layers] == 0) & (cells[:, layers : 2 * layers] == 0)
    return nothing & (cells[:, 2 * layers :] == 0)  # pyright: ignore[reportReturnType] - arrays and tensors


def as_channels(cells: np.ndarray) -> np.ndarray:
    """Return kept channels as the network reads them, float32."""
    return cells.astype(np.float32) / np.float32(STEPS)


def drawn_batch(
    cells: torch.Tensor, truth: torch.Tensor, chosen: torch.Tensor, rng: np.random.Generator
) -> list[torch.Tensor]:
    """Return channels, truth and what is asked for of some samples, all turned and mirrored in one way.

    Args:
        cells: (N, 2·L + 1, C, C) uint8 of all samples; like all tensors on the device for learning.
        truth: (N, L, C, C) bool.
        chosen: (B,) int64, numbers of samples.
        rng: Draws turn and mirroring.
    """
    turns, mirrored = int(rng.integers(4)), bool(rng.integers(2))
    batch = []
    for values in (cells[chosen], truth[chosen]):
        turned = torch.rot90(values, turns, dims=(-2, -1))
        batch.append(turned.transpose(-2, -1) if mirrored else turned)
    drawn, solid = batch
    channels = (drawn.float() / STEPS).contiguous(memory_format=torch.channels_last)
    return [channels, solid.float().contiguous(), unmeasured(drawn).float().contiguous()]
