"""The peers: packages of others at the job that is nearest to ours, on one thread."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from entropy_explore_env.errors import imported

_PEERS = {"octomap": "octomap-python", "mpe2.simple_spread_v3": "mpe2"}
"""Module → package."""
_PRECOMPUTED = 64


def load_peer(module: str) -> Any:  # noqa: ANN401 - a module
    """Import a peer.

    Raises:
        MissingExtraError: It is not installed.
    """
    os.environ["OMP_NUM_THREADS"] = "1"  # OctoMap's wheels may be built with OpenMP
    return imported(module, _PEERS[module], "bench")


def load_peers() -> None:
    """Import all peers, so that a missing one is told before anything is measured."""
    for module in _PEERS:
        load_peer(module)


class OctoMapTree:
    """OctoMap's octree (Hornung et al. 2013), with the sensor model that it comes with."""

    def __init__(self, voxel_size_m: float) -> None:
        """Make an empty tree."""
        self._tree = load_peer("octomap").OcTree(voxel_size_m)

    def insert(self, positions_m: np.ndarray, ends_m: np.ndarray) -> None:
        """Insert scans, (S, 3) to (S, R, 3), exactly: rays whole, inner nodes updated, ends not merged."""
        for position, ends in zip(positions_m, ends_m, strict=True):
            self._tree.insertPointCloud(ends, position, maxrange=-1.0, lazy_eval=False, discretize=False)


class Spread:
    """Simple spread of MPE2 (Lowe et al. 2017): particles without sensing or mapping, N agents."""

    def __init__(self, agents: int, seed: int) -> None:
        """Start an episode that does not end; actions are drawn beforehand."""
        self._env = load_peer("mpe2.simple_spread_v3").parallel_env(N=agents, max_cycles=2**62)
        self._env.reset(seed=seed)
        numbers = np.random.default_rng(seed).integers(0, 5, (_PRECOMPUTED, agents)).tolist()
        self._actions = [dict(zip(self._env.agents, row, strict=True)) for row in numbers]

    def run(self, steps: int) -> None:
        """Take some steps."""
        for step in range(steps):
            self._env.step(self._actions[step % _PRECOMPUTED])
