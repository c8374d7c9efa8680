"""The strategy `assigned-frontier`: groups of frontier cells, assigned to all robots at the least cost.

Frontier cells are put into groups, each within a radius of one cell. All robots that are known, under way or
not, are assigned to different groups so that the sum of the path lengths is least (the Hungarian method, Kuhn
1955). A robot without a group, there being fewer than robots, goes to the nearest one.

The radius of groups is tuned; see docs/explorers.md.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import linear_sum_assignment

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.knowledge import teammates_that_share, voxel_of
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import Scene, best_of

_UNREACHED = 1e9
"""Length, in voxel edges, in place of inf, which the assignment cannot take."""


class AssignedFrontier(FrontierRule):
    """Goes to the group of frontier cells that the optimal assignment of all robots gives it."""

    rule = "assigned-frontier"
    radius = 0.25
    """Radius of a group, in sensor ranges."""

    def pick(self, scene: Scene) -> int:
        """Return the voxel to go to; see `FrontierRule`."""
        voxels, lengths = scene.paths.frontiers_within(math.inf)
        if len(voxels) == 0:
            return NONE
        heard = [mate for mate in teammates_that_share(scene.view).values() if mate.heard_s >= 0.0]
        known = np.array([voxel_of(scene.view, mate.pose) for mate in heard], np.int32)
        group = groups(scene.centres(voxels), self.radius * scene.cells.reach)
        apart = scene.lengths_of_team(voxels, lengths, known)
        least = np.full((len(apart), int(group.max()) + 1), _UNREACHED)
        for robot, row in enumerate(apart):
            np.minimum.at(least[robot], group, np.minimum(row, _UNREACHED))
        robots, assigned = linear_sum_assignment(least)
        mine = assigned[robots == 0]
        worth = np.where(group == mine[0], -lengths, -np.inf) if len(mine) else -lengths
        return best_of(voxels, worth, scene.target)


def groups(places: np.ndarray, radius: float) -> np.ndarray:
    """Return the number (K,) of each place's group: in turn, a place that is in none yet begins one.

    Args:
        places: (K, 3).
        radius: All places of a group are within it of the one that began it.
    """
    group, count = np.full(len(places), -1), 0
    for first in range(len(places)):
        if group[first] < 0:
            near = np.linalg.norm(places - places[first], axis=1) <= radius
            group[near & (group < 0)] = count
            count += 1
    return group
