"""The strategy `distance-advantage` (Ericson, Pedro & Jensfelt 2025): near to the robot, far from all else.

    v* = argmax over frontier cells v of Adv(v),   Adv(v) = mean over u of d(u, v) - d(robot, v)

u are the free cells around the robot: those that it can reach, up to a radius off along either axis. d is
the length of the path through known free space. What would be far to come back to is taken now. Only
frontier cells whose path is no longer than a horizon count; if none is within it, the nearest one counts.

What there is to gain is no part of the worth, and leaves no cell out: a single frontier cell that is left for
later costs a way back to it.

The mean needs a search from each frontier cell. Most are spared: since d(u, v) ≤ d(u, w) + d(w, v), a cell
w whose mean is known bounds the advantage of every other one from above, and cells whose bounds are below
the best advantage so far are never searched from. The choice is the same.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import Scene, best_of


class DistanceAdvantage(FrontierRule):
    """Goes to the frontier cell with the greatest distance advantage."""

    rule = "distance-advantage"
    radius = 60
    """Voxels, along either axis, that u may be off the robot."""
    horizon = 61.0
    """Longest path, in voxel edges, to a frontier cell that counts though it is not the nearest."""
    detour = 8.0
    """u that are farther from the robot than this many radii, by path, do not count."""

    def pick(self, scene: Scene) -> int:
        """Return the voxel to go to; see `FrontierRule`."""
        paths = scene.paths
        voxels, lengths = paths.frontiers_within(self.horizon)
        if len(voxels) == 0:
            voxels, lengths = paths.nearest_frontiers()
            return best_of(voxels, -lengths, scene.target)
        paths.extend(self.detour * self.radius)
        around = paths.around(scene.here, self.radius)
        return best_of(voxels, advantages(paths, voxels, lengths, around), scene.target)


def advantages(
    paths: KnownPaths,
    voxels: np.ndarray,
    lengths: np.ndarray,
    around: np.ndarray,
) -> np.ndarray:
    """Return the distance advantages of frontier cells, as far as it takes to know the greatest.

    Args:
        paths: Of the robot, whose search is another one afterwards.
        voxels: (K,) int32, the frontier cells.
        lengths: (K,) of the paths from the robot to them.
        around: (N,) int32, the free cells around the robot, which its search has reached.

    Returns:
        (K,) in voxel edges; -inf for cells that cannot have the greatest.
    """
    farthest = float(paths.lengths_to(around).max(initial=0.0))
    worth, bounds = np.full(len(voxels), -np.inf), np.full(len(voxels), np.inf)
    place = int(np.argmin(lengths))
    while bounds[place] > worth.max():
        least, most = abs(farthest - lengths[place]), farthest + lengths[place]
        mean = paths.mean_length(int(voxels[place]), around, least, most)
        worth[place] = mean - lengths[place]
        bounds = np.minimum(bounds, mean + paths.lengths_to(voxels) - lengths)
        bounds[np.isfinite(worth)] = -np.inf
        place = int(np.argmax(bounds))
    return worth
