"""The peers: other people's packages at the job that is nearest to ours, on one thread."""

from __future__ import annotations

import importlib
import os
from types import ModuleType
from typing import Any

import numpy as np

from entropy_explore_env.errors import MissingExtraError

_EXTRA = "bench"
_PRECOMPUTED = 64


def load_peer(module: str, package: str) -> ModuleType:
    """Import a peer.

    Args:
        module: What is imported.
        package: What is installed.

    Raises:
        MissingExtraError: It is not installed.
    """
    os.environ["OMP_NUM_THREADS"] = "1"  # OctoMap's wheels may be built with OpenMP
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(package, _EXTRA) from None


def load_octomap() -> ModuleType:
    """octomap-python."""
    return load_peer("octomap", "octomap-python")


def load_spread() -> ModuleType:
    """simple_spread of mpe2."""
    return load_peer("mpe2.simple_spread_v3", "mpe2")


class OctoMapTree:
    """OctoMap's octree (Hornung et al. 2013), with the sensor model that it comes with."""

    def __init__(self, voxel_size_m: float) -> None:
        """Make an empty tree."""
        self._tree: Any = load_octomap().OcTree(voxel_size_m)

    def insert(self, positions_m: np.ndarray, ends_m: np.ndarray) -> None:
        """Insert scans exactly: every ray whole, inner nodes updated, end points not merged.

        Args:
            positions_m: (S, 3) float64, where each scan was taken.
            ends_m: (S, R, 3) float64, what its rays hit.
        """
        insert = self._tree.insertPointCloud
        for position, ends in zip(positions_m, ends_m, strict=True):
            insert(ends, position, maxrange=-1.0, lazy_eval=False, discretize=False)


class Spread:
    """Simple spread of MPE2 (Lowe et al. 2017): particles without sensing or mapping, N agents."""

    def __init__(self, agents: int, seed: int) -> None:
        """Start an episode that does not end; actions are drawn beforehand."""
        self._env: Any = load_spread().parallel_env(N=agents, max_cycles=2**62)
        self._env.reset(seed=seed)
        numbers = np.random.default_rng(seed).integers(0, 5, (_PRECOMPUTED, agents))
        self._actions = [
            dict(zip(self._env.agents, (int(number) for number in row), strict=True)) for row in numbers
        ]

    def run(self, steps: int) -> None:
        """Take some steps."""
        env, actions = self._env, self._actions
        for step in range(steps):
            env.step(actions[step % _PRECOMPUTED])
