"""How `planned-rate` explores plans of which everything is to be seen: short open tours, shared among a team.

Each robot plans a tour, as `tour` does, through the frontier cells that are nearer to it, by its paths, than
to where teammates go, by the straight line; where there is none, through all of them. A tour does not leave
behind what it would have to come back for: in plans it drives shorter paths than rules that choose one
frontier cell at a time.

Tuned: see docs/explorers.md.
"""

from __future__ import annotations

import numpy as np

from baselines.strategies.explorers.explorer import Scene
from baselines.strategies.explorers.teammates import left_to_robot
from baselines.strategies.explorers.tour import Tour


class SharedTour(Tour):
    """Goes to the first place of a tour through what teammates leave to the robot."""

    rule = "planned-rate"

    def pick_among(self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> int:
        """See `Tour`."""
        own = left_to_robot(scene, voxels, lengths)
        return super().pick_among(scene, voxels[own], lengths[own])
