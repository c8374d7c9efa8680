"""The strategy `nearest-frontier` (Yamauchi 1997, 1998): the frontier cell with the shortest path.

    v* = argmin over frontier cells v of d(robot, v)

d is the length of the path through known free space. Of equally near cells the one to which the robot is
already under way is kept. Robots share their maps and do not coordinate otherwise, as in the paper of 1998.

It has no parameters.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.planner.driver import Explorer, Scene


class NearestFrontier(Explorer):
    """Goes to the nearest frontier cell."""

    rule = "nearest-frontier"

    def pick(self, scene: Scene) -> int:
        """See `Explorer`."""
        voxels, lengths = scene.paths.nearest_frontiers()
        return best_of(voxels, -lengths, scene.target)


def best_of(voxels: np.ndarray, worth: np.ndarray, target: int) -> int:
    """The voxel that is worth most, of equals the target; NONE = there are no voxels, or all are worth -inf.

    Args:
        voxels: (K,) candidates.
        worth: (K,) of them.
        target: The voxel that was chosen before; NONE = none was.
    """
    if len(voxels) == 0 or worth.max() == -np.inf:
        return NONE
    kept = np.flatnonzero(voxels == target)
    most = float(worth.max())
    if len(kept) and worth[kept[0]] >= most - 1e-9 * max(abs(most), 1.0):
        return target
    return int(voxels[int(np.argmax(worth))])
