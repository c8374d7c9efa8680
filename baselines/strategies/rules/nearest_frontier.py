"""The strategy `nearest-frontier` (Yamauchi 1997, 1998): the frontier cell with the shortest path.

    v* = argmin over frontier cells v of d(robot, v)

d is the length of the path through known free space. Of equally near cells the one to which the robot is
already under way is kept. Robots share their maps and do not coordinate otherwise, as in the paper of 1998.

It has no parameters.
"""

from __future__ import annotations

from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import Scene, best_of


class NearestFrontier(FrontierRule):
    """Goes to the nearest frontier cell."""

    rule = "nearest-frontier"

    def pick(self, scene: Scene) -> int:
        """Return the voxel to go to; see `FrontierRule`."""
        voxels, lengths = scene.paths.nearest_frontiers()
        return best_of(voxels, -lengths, scene.target)
