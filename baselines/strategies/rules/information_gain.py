"""The strategy `information-gain`: how much will be seen from a frontier cell, against the path to it.

    v* = argmax over frontier cells v of λ log(1 + gain(v)) - d(robot, v)

gain is the number of unknown voxels that the sensor would see from v, were all that is unknown free; d is
the length of the path in voxel edges. This is the gain-maximising rule that Ericson, Pedro & Jensfelt 2025
compare with; like theirs it considers frontier cells up to a horizon, beyond it only the nearest. Their
gain is the true one, which no robot knows; this one is the robot's own expectation.

Gains are counted only for cells that can be best: all that is known of a gain is that it is no more than at
an earlier count, but for what has turned free since.

λ is tuned: docs/explorers.md.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import Scene, best_of


class InformationGain(FrontierRule):
    """Goes to the frontier cell with the best balance of gain and path."""

    rule = "information-gain"
    weight = 0.05
    """λ, in sensor ranges."""
    horizon = 3.0
    """Longest path, in sensor ranges, to a frontier cell that counts though it is not the nearest."""

    def pick(self, scene: Scene) -> int:
        """Return the voxel to go to; see `FrontierRule`."""
        horizon = self.horizon * scene.cells.reach
        scene.paths.extend(horizon)
        voxels = scene.cells.listed(all_of_them=True)
        lengths = scene.paths.lengths_to(voxels)
        near = lengths <= min(horizon, scene.paths.reach)
        if near.sum() <= 1:
            voxels, lengths = scene.paths.nearest_frontiers()
            return best_of(voxels, -lengths, scene.target)
        voxels, lengths = voxels[near], lengths[near]
        weight = self.weight * scene.cells.reach

        def worth(gains: np.ndarray, which: np.ndarray) -> np.ndarray:
            return np.asarray(weight * np.log1p(gains) - lengths[which])

        return best_of(voxels, scene.cells.worths(voxels, worth), scene.target)
